#include "telemetry/mission_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <set>

#include "signals/sample.h"

namespace joulecast::telemetry {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::int64_t tracker_second_us = 1'000'000;

// "open m-1 @5" or "close m-1 @9 finished", times in seconds.
std::vector<std::string> told(const MissionActions& actions) {
  constexpr const char* ends[] = {"finished", "aborted", "superseded", "unfinished", "idle", "expired"};
  std::vector<std::string> lines;
  for (const MissionAction& action : actions) {
    const std::string where = action.mission_id + " @" + std::to_string(action.utime_us / tracker_second_us);
    lines.push_back(action.kind == MissionAction::Kind::open
                        ? "open " + where
                        : "close " + where + " " + ends[static_cast<std::size_t>(action.end)]);
  }
  return lines;
}

class MissionTrackerTest : public ::testing::Test {
 protected:
  std::vector<std::string> sample(std::int64_t second) {
    SampleStep step = tracker.on_sample(second * tracker_second_us, 4.0);
    belongs = step.belongs;
    return told(step.actions);
  }
  std::vector<std::string> event(signals::MissionPhase phase, const std::string& id, std::int64_t second) {
    return told(tracker.on_event({second * tracker_second_us, id, phase, 7.0, "note"}));
  }
  std::vector<std::string> started(const std::string& id, std::int64_t second) {
    return event(signals::MissionPhase::started, id, second);
  }
  std::vector<std::string> finished(const std::string& id, std::int64_t second) {
    return event(signals::MissionPhase::finished, id, second);
  }
  std::vector<std::string> aborted(const std::string& id, std::int64_t second) {
    return event(signals::MissionPhase::aborted, id, second);
  }

  MissionTracker tracker;
  bool belongs = false;
};

TEST_F(MissionTrackerTest, ExplicitMission) {
  const MissionActions opened =
      tracker.on_event({5 * tracker_second_us, "m-1", signals::MissionPhase::started, 7.0, "to dock"});
  ASSERT_EQ(opened.size(), 1u);
  EXPECT_EQ(opened[0].payload_kg, 7.0);
  EXPECT_EQ(opened[0].note, "to dock");
  EXPECT_FALSE(opened[0].implicit);
  EXPECT_THAT(sample(6), IsEmpty());
  EXPECT_TRUE(belongs);
  EXPECT_THAT(finished("m-1", 9), ElementsAre("close m-1 @9 finished"));
  EXPECT_FALSE(tracker.current());
}

TEST_F(MissionTrackerTest, AbortedMission) {
  started("m-1", 5);
  EXPECT_THAT(aborted("m-1", 7), ElementsAre("close m-1 @7 aborted"));
}

TEST_F(MissionTrackerTest, SamplesOpenAnImplicitMission) {
  EXPECT_THAT(sample(3), ElementsAre("open implicit-3000000 @3"));
  EXPECT_TRUE(belongs);
  EXPECT_TRUE(tracker.current()->implicit);
  EXPECT_EQ(tracker.current()->payload_kg, 4.0);
  EXPECT_THAT(sample(4), IsEmpty());
  EXPECT_THAT(started("m-1", 5), ElementsAre("close implicit-3000000 @4 superseded", "open m-1 @5"));
}

TEST_F(MissionTrackerTest, SilenceEndsImplicitMission) {
  sample(3);
  sample(10);
  EXPECT_THAT(sample(71), ElementsAre("close implicit-3000000 @10 idle", "open implicit-71000000 @71"));
  EXPECT_THAT(told(tracker.on_silence(60 * tracker_second_us)), IsEmpty());
  EXPECT_THAT(told(tracker.on_silence(60 * tracker_second_us + 1)),
              ElementsAre("close implicit-71000000 @71 idle"));
  EXPECT_THAT(told(tracker.on_silence(900 * tracker_second_us)), IsEmpty());
}

TEST_F(MissionTrackerTest, CutsImplicitMissionAtLimit) {
  sample(0);
  for (std::int64_t t = 50; t <= 3600; t += 50) EXPECT_THAT(sample(t), IsEmpty());
  EXPECT_THAT(sample(3601), ElementsAre("close implicit-0 @3600 expired", "open implicit-3601000000 @3601"));
}

TEST_F(MissionTrackerTest, MissionNeverFinished) {
  started("m-1", 0);
  sample(1);
  EXPECT_THAT(sample(601), IsEmpty());
  EXPECT_THAT(sample(1202), ElementsAre("close m-1 @601 unfinished", "open implicit-1202000000 @1202"));
  started("m-2", 1203);
  EXPECT_THAT(told(tracker.on_silence(601 * tracker_second_us)), ElementsAre("close m-2 @1203 unfinished"));
}

TEST_F(MissionTrackerTest, ExplicitMissionOutlivesLimit) {
  started("m-1", 0);
  for (std::int64_t t = 500; t <= 86'400; t += 100) EXPECT_THAT(sample(t), IsEmpty());
  EXPECT_THAT(sample(86'401), ElementsAre("close m-1 @86400 unfinished", "open implicit-86401000000 @86401"));
}

TEST_F(MissionTrackerTest, StartSupersedesOpenMission) {
  started("m-1", 0);
  sample(3);
  EXPECT_THAT(started("m-2", 4), ElementsAre("close m-1 @3 superseded", "open m-2 @4"));
  EXPECT_THAT(finished("m-1", 5), IsEmpty());
  EXPECT_EQ(tracker.counters().duplicate_events, 1u);
  EXPECT_EQ(tracker.current()->mission_id, "m-2");
}

TEST_F(MissionTrackerTest, RepeatedEventsChangeNothing) {
  started("m-1", 0);
  EXPECT_THAT(started("m-1", 0), IsEmpty());
  finished("m-1", 5);
  EXPECT_THAT(finished("m-1", 5), IsEmpty());
  EXPECT_THAT(started("m-1", 0), IsEmpty());
  EXPECT_EQ(tracker.counters().duplicate_events, 3u);
  EXPECT_FALSE(tracker.current());
}

TEST_F(MissionTrackerTest, RejectsStartOutOfOrder) {
  started("m-2", 10);
  EXPECT_THAT(started("m-1", 8), IsEmpty());
  EXPECT_EQ(tracker.counters().out_of_order_events, 1u);
  EXPECT_EQ(tracker.current()->mission_id, "m-2");
}

TEST_F(MissionTrackerTest, OldStartIndicatesClockStep) {
  started("m-2", 1000);
  EXPECT_THAT(started("m-3", 8), ElementsAre("close m-2 @1000 superseded", "open m-3 @8"));
}

TEST_F(MissionTrackerTest, EarlyEndCancelsLateStart) {
  EXPECT_THAT(finished("m-1", 5), IsEmpty());
  EXPECT_EQ(tracker.counters().unknown_missions, 1u);
  EXPECT_THAT(started("m-1", 4), IsEmpty());
  EXPECT_EQ(tracker.counters().out_of_order_events, 1u);
}

TEST_F(MissionTrackerTest, OldEndUsesLastSample) {
  started("m-1", 5);
  sample(6);
  EXPECT_THAT(finished("m-1", 4), ElementsAre("close m-1 @6 finished"));
  EXPECT_EQ(tracker.counters().out_of_order_events, 1u);
}

TEST_F(MissionTrackerTest, UnknownEndEndsImplicitOnly) {
  started("m-2", 0);
  EXPECT_THAT(finished("m-1", 1), IsEmpty());
  EXPECT_EQ(tracker.current()->mission_id, "m-2");
  finished("m-2", 2);
  sample(10);
  const MissionActions actions =
      tracker.on_event({12 * tracker_second_us, "m-9", signals::MissionPhase::aborted, 0, ""});
  EXPECT_THAT(told(actions), ElementsAre("close implicit-10000000 @12 aborted"));
  EXPECT_NE(actions[0].note.find("m-9"), std::string::npos);
}

// For example when its start fell into the daemon's downtime.
TEST_F(MissionTrackerTest, LaterEndEndsOpenMission) {
  tracker.resume({"m-2", 0, 12 * tracker_second_us, 2.0, false});
  sample(20);
  const MissionActions actions =
      tracker.on_event({30 * tracker_second_us, "m-3", signals::MissionPhase::finished, 0, ""});
  EXPECT_THAT(told(actions), ElementsAre("close m-2 @30 superseded"));
  EXPECT_NE(actions[0].note.find("m-3"), std::string::npos);
  EXPECT_EQ(tracker.counters().unknown_missions, 1u);
  EXPECT_FALSE(tracker.current());
  EXPECT_THAT(started("m-4", 40), ElementsAre("open m-4 @40"));
}

TEST_F(MissionTrackerTest, SamplesAfterEndOpenNothing) {
  started("m-1", 0);
  finished("m-1", 10);
  for (const std::int64_t utime :
       {10 * tracker_second_us, 10 * tracker_second_us + 1, 10 * tracker_second_us + 500'000}) {
    EXPECT_FALSE(tracker.on_sample(utime, 0).belongs);
  }
  EXPECT_EQ(tracker.counters().samples_outside, 3u);
  EXPECT_TRUE(tracker.on_sample(10 * tracker_second_us + 500'001, 0).belongs);
}

TEST_F(MissionTrackerTest, ExcludesSamplesBeforeStart) {
  started("m-1", 5);
  EXPECT_THAT(sample(4), IsEmpty());
  EXPECT_FALSE(belongs);
}

TEST_F(MissionTrackerTest, EndsNotBeforeNewestSample) {
  started("m-1", 0);
  tracker.on_sample(9 * tracker_second_us + 20, 0);
  const MissionActions actions =
      tracker.on_event({9 * tracker_second_us, "m-1", signals::MissionPhase::finished, 0, ""});
  EXPECT_EQ(actions.at(0).utime_us, 9 * tracker_second_us + 20);
}

TEST_F(MissionTrackerTest, CountsReplayedMissionOnce) {
  std::size_t actions = 0;
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1) tracker.on_clock_step(1 * tracker_second_us);
    actions += started("m-1", 0).size();
    for (std::int64_t t = 1; t < 10; ++t) actions += sample(t).size();
    actions += finished("m-1", 10).size();
  }
  EXPECT_EQ(actions, 2u);  // open and close
  EXPECT_EQ(tracker.counters().samples_outside, 9u);
}

TEST_F(MissionTrackerTest, ContinuesThroughClockStep) {
  started("m-1", 1000);
  sample(1010);
  tracker.on_clock_step(20 * tracker_second_us);
  EXPECT_THAT(sample(20), IsEmpty());
  EXPECT_TRUE(belongs);
  EXPECT_THAT(finished("m-1", 25), ElementsAre("close m-1 @25 finished"));
}

TEST_F(MissionTrackerTest, ResumesStoredMission) {
  tracker.resume({"m-1", 0, 5 * tracker_second_us, 2.0, false});
  EXPECT_THAT(sample(6), IsEmpty());
  EXPECT_TRUE(belongs);
  EXPECT_THAT(finished("m-1", 9), ElementsAre("close m-1 @9 finished"));
}

TEST_F(MissionTrackerTest, ReusedIdIsAnotherMission) {
  started("1", 0);
  sample(5);
  finished("1", 10);
  EXPECT_THAT(started("1", 100), ElementsAre("open 1 @100"));
  EXPECT_THAT(sample(101), IsEmpty());
  EXPECT_TRUE(belongs);
  EXPECT_THAT(started("1", 100), IsEmpty());  // repeated
  EXPECT_THAT(started("1", 0), IsEmpty());    // the first one's, late
  EXPECT_THAT(finished("1", 10), IsEmpty());  // the first one's, late
  EXPECT_EQ(tracker.counters().duplicate_events, 3u);
  EXPECT_THAT(finished("1", 110), ElementsAre("close 1 @110 finished"));
}

TEST_F(MissionTrackerTest, RestartedCountBeginsAnotherMission) {
  started("1", 0);
  sample(30);
  EXPECT_THAT(started("1", 60), ElementsAre("close 1 @30 superseded", "open 1 @60"));
  EXPECT_THAT(finished("1", 70), ElementsAre("close 1 @70 finished"));
}

TEST_F(MissionTrackerTest, ReusedIdAfterClockStep) {
  started("1", 1000);
  sample(1010);
  finished("1", 1020);
  EXPECT_THAT(started("1", 10), ElementsAre("open 1 @10"));
  EXPECT_THAT(sample(11), IsEmpty());
  EXPECT_TRUE(belongs);
  EXPECT_THAT(finished("1", 20), ElementsAre("close 1 @20 finished"));
}

TEST_F(MissionTrackerTest, RecognisesStartWithNewStamp) {
  started("1", 0);
  EXPECT_THAT(started("1", 4), IsEmpty());
  finished("1", 60);
  EXPECT_THAT(started("1", 3), IsEmpty());
  EXPECT_EQ(tracker.counters().duplicate_events, 2u);
}

TEST_F(MissionTrackerTest, EndsReusedShortMission) {
  started("1", 0);
  finished("1", 100);
  started("1", 101);
  EXPECT_THAT(finished("1", 103), ElementsAre("close 1 @103 finished"));
}

TEST_F(MissionTrackerTest, ReusedIdEndsImplicitMission) {
  started("1", 0);
  finished("1", 10);
  sample(50);
  EXPECT_THAT(finished("1", 60), ElementsAre("close implicit-50000000 @60 finished"));
  EXPECT_EQ(tracker.counters().unknown_missions, 1u);
  EXPECT_THAT(started("1", 100), ElementsAre("open 1 @100"));
}

TEST_F(MissionTrackerTest, RecognisesStartOfStoredMission) {
  tracker.resume({"1", 0, 50 * tracker_second_us, 2.0, false});
  EXPECT_THAT(started("1", 0), IsEmpty());
  EXPECT_THAT(started("1", 60), ElementsAre("close 1 @50 superseded", "open 1 @60"));
}

// For any input, actions alternate between open and close of the same mission, and no mission (an id and a
// start) opens twice.
TEST(MissionTrackerProperty, ActionsAlwaysPair) {
  EXPECT_TRUE(rc::check([] {
    MissionTracker tracker;
    std::string open;
    std::set<std::pair<std::string, std::int64_t>> known;
    const auto follow = [&](const MissionActions& actions) {
      for (const MissionAction& action : actions) {
        if (action.kind == MissionAction::Kind::open) {
          RC_ASSERT(open.empty());
          RC_ASSERT(known.insert({action.mission_id, action.utime_us}).second);
          open = action.mission_id;
        } else {
          RC_ASSERT(open == action.mission_id);
          open.clear();
        }
      }
      RC_ASSERT(open == (tracker.current() ? tracker.current()->mission_id : ""));
    };
    const int steps = *rc::gen::inRange(1, static_cast<int>(MissionTracker::memory));
    std::int64_t utime = 0;
    for (int i = 0; i < steps; ++i) {
      utime += *rc::gen::inRange<std::int64_t>(1, 100 * tracker_second_us);
      switch (*rc::gen::inRange(0, 4)) {
        case 0:
          follow(tracker.on_event({utime, "m-" + std::to_string(*rc::gen::inRange(0, 30)),
                                   static_cast<signals::MissionPhase>(*rc::gen::inRange(1, 4)), 0, ""}));
          break;
        case 1:
          follow(tracker.on_silence(*rc::gen::inRange<std::int64_t>(0, 1000 * tracker_second_us)));
          break;
        default:
          follow(tracker.on_sample(utime, 0).actions);
      }
    }
  }));
}

}  // namespace
}  // namespace joulecast::telemetry
