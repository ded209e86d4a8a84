#include "telemetry/sequence_tracker.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <limits>

namespace joulecast::telemetry {
namespace {

constexpr std::int64_t base_us = 1'700'000'000'000'000;
constexpr std::int64_t period_us = 10'000;

std::int64_t at(std::int64_t index) {
  return base_us + index * period_us;
}

class SequenceTrackerTest : public ::testing::Test {
 protected:
  // A running stream up to sample number `last`.
  void run_to(std::int64_t last) {
    for (std::int64_t i = 0; i <= last; ++i) tracker.place(i, at(i));
  }
  SequenceTracker tracker;
};

TEST_F(SequenceTrackerTest, FirstThenFresh) {
  EXPECT_EQ(tracker.place(17, at(17)).arrival, Arrival::first);
  const Placement next = tracker.place(18, at(18));
  EXPECT_EQ(next.arrival, Arrival::fresh);
  EXPECT_EQ(next.elapsed_us, period_us);
  EXPECT_EQ(next.missing, 0);
  EXPECT_TRUE(next.continues());
  EXPECT_EQ(tracker.counters().fresh, 2u);
}

TEST_F(SequenceTrackerTest, FirstDoesNotContinueAnything) {
  const Placement first = tracker.place(0, at(0));
  EXPECT_TRUE(first.advances());
  EXPECT_FALSE(first.continues());
}

TEST_F(SequenceTrackerTest, DuplicatesDoNotAdvance) {
  run_to(20);
  for (const std::int64_t number : {20, 19, 3}) {
    const Placement placement = tracker.place(number, at(number));
    EXPECT_EQ(placement.arrival, Arrival::duplicate);
    EXPECT_FALSE(placement.advances());
  }
  EXPECT_EQ(tracker.place(21, at(21)).elapsed_us, period_us);
  EXPECT_EQ(tracker.counters().duplicate, 3u);
}

TEST_F(SequenceTrackerTest, LateSampleFillsGapOnce) {
  run_to(10);
  EXPECT_EQ(tracker.place(13, at(13)).missing, 2);
  EXPECT_EQ(tracker.place(11, at(11)).arrival, Arrival::late);
  EXPECT_EQ(tracker.place(11, at(11)).arrival, Arrival::duplicate);
  EXPECT_EQ(tracker.place(12, at(12)).arrival, Arrival::late);
  EXPECT_EQ(tracker.counters().missing, 2u);
  EXPECT_EQ(tracker.counters().late, 2u);
}

TEST_F(SequenceTrackerTest, RestartWithRunningClockContinues) {
  run_to(500);
  const Placement boot = tracker.place(0, at(501));
  EXPECT_EQ(boot.arrival, Arrival::restart);
  EXPECT_EQ(boot.clock, ClockStep::none);
  EXPECT_TRUE(boot.continues());
  EXPECT_EQ(tracker.place(1, at(502)).arrival, Arrival::fresh);
  EXPECT_EQ(tracker.place(1, at(502)).arrival, Arrival::duplicate);
  EXPECT_EQ(tracker.counters().restarts, 1u);
  EXPECT_EQ(tracker.counters().missing, 0u);
}

TEST_F(SequenceTrackerTest, OneCorruptNumberIsNoRestart) {
  run_to(1199);
  tracker.place(0, at(1200));
  const Placement next = tracker.place(1203, at(1203));
  EXPECT_EQ(next.arrival, Arrival::fresh);
  EXPECT_EQ(next.missing, 2);
  EXPECT_EQ(tracker.counters().restarts, 0u);
  EXPECT_EQ(tracker.place(1203, at(1203)).arrival, Arrival::duplicate);
  // Of a restart, the second sample shows that.
  tracker.place(0, at(1300));
  tracker.place(1, at(1301));
  EXPECT_EQ(tracker.place(1205, at(1400)).missing, 1203);
  EXPECT_EQ(tracker.counters().restarts, 1u);
  tracker.place(0, 1'000'000);
  EXPECT_EQ(tracker.place(1210, 1'010'000).missing, 1209);
  EXPECT_EQ(tracker.counters().restarts, 2u);
}

TEST_F(SequenceTrackerTest, RestartForgetsEarlierNumbers) {
  run_to(10);
  tracker.place(0, at(20));
  tracker.place(1, at(21));
  tracker.place(3, at(23));
  EXPECT_EQ(tracker.place(2, at(22)).arrival, Arrival::late);
}

TEST_F(SequenceTrackerTest, DetectsSecondRestartSoonAfter) {
  run_to(3);
  EXPECT_EQ(tracker.place(0, at(400)).arrival, Arrival::restart);
}

TEST_F(SequenceTrackerTest, DetectsRestartWithEarlierClock) {
  run_to(3);
  const Placement boot = tracker.place(0, 1'000'000);
  EXPECT_EQ(boot.arrival, Arrival::restart);
  EXPECT_EQ(boot.clock, ClockStep::backward);
  EXPECT_FALSE(boot.continues());
  EXPECT_EQ(tracker.place(1, 1'010'000).arrival, Arrival::fresh);
}

TEST_F(SequenceTrackerTest, DetectsStoppedOrReversedClock) {
  run_to(10);
  EXPECT_EQ(tracker.place(11, at(10)).clock, ClockStep::backward);
  const Placement back = tracker.place(12, at(8));
  EXPECT_EQ(back.arrival, Arrival::fresh);
  EXPECT_EQ(back.clock, ClockStep::backward);
  EXPECT_FALSE(back.continues());
  EXPECT_TRUE(tracker.place(13, at(9)).continues());
  EXPECT_EQ(tracker.counters().clock_backward, 2u);
}

TEST_F(SequenceTrackerTest, DetectsForwardJumpAboveLimit) {
  run_to(0);
  EXPECT_TRUE(tracker.place(1, base_us + forward_jump_us).continues());
  const Placement jump = tracker.place(2, base_us + 2 * forward_jump_us + 1);
  EXPECT_EQ(jump.clock, ClockStep::forward);
  EXPECT_FALSE(jump.continues());
}

TEST_F(SequenceTrackerTest, PowerOffKeepsClock) {
  run_to(10);
  const Placement boot = tracker.place(0, at(10) + 3 * 24 * 3'600'000'000LL);
  EXPECT_EQ(boot.arrival, Arrival::restart);
  EXPECT_EQ(boot.clock, ClockStep::none);
  EXPECT_TRUE(boot.continues());
}

TEST_F(SequenceTrackerTest, ImplausibleLeapIsARestart) {
  run_to(0);
  EXPECT_EQ(tracker.place(max_missing + 1, at(1)).missing, max_missing);
  EXPECT_EQ(tracker.place(2 * max_missing + 3, at(2)).arrival, Arrival::restart);
  EXPECT_EQ(tracker.counters().missing, static_cast<std::uint64_t>(max_missing));
}

TEST_F(SequenceTrackerTest, OldNumberKeepsNewerOnes) {
  run_to(100);
  EXPECT_EQ(tracker.place(100 - 64, at(100 - 64)).arrival, Arrival::late);
  EXPECT_EQ(tracker.place(100, at(100)).arrival, Arrival::duplicate);
}

TEST_F(SequenceTrackerTest, ExtremesDoNotOverflow) {
  constexpr auto lowest = std::numeric_limits<std::int64_t>::min();
  constexpr auto highest = std::numeric_limits<std::int64_t>::max();
  for (const auto sequence : {highest, lowest, std::int64_t{0}, highest}) {
    for (const auto utime : {lowest, highest, std::int64_t{0}}) tracker.place(sequence, utime);
  }
  EXPECT_EQ(tracker.counters().received, 12u);
}

// A stream with losses, repetitions and reordering within the memory: the counts of advancing and lost
// samples are exact.
TEST(SequenceTrackerProperty, CountsLossesAndRepetitions) {
  EXPECT_TRUE(rc::check([] {
    SequenceTracker tracker;
    std::uint64_t skipped = 0;
    std::uint64_t repeated = 0;
    std::uint64_t delayed = 0;
    std::int64_t newest = 0;
    tracker.place(0, at(0));
    const auto send_next = [&] {
      ++newest;
      tracker.place(newest, at(newest));
    };
    const int steps = *rc::gen::inRange(1, 200);
    for (int i = 0; i < steps; ++i) {
      switch (*rc::gen::inRange(0, 5)) {
        case 0:  // lost
          ++newest;
          ++skipped;
          send_next();
          break;
        case 1:  // repeated
          tracker.place(newest, at(newest));
          ++repeated;
          break;
        case 2:  // overtaken by its successor
        {
          const std::int64_t held = ++newest;
          ++skipped;
          ++delayed;
          send_next();
          tracker.place(held, at(held));
          break;
        }
        default:
          send_next();
      }
    }
    const SequenceCounters& counters = tracker.counters();
    RC_ASSERT(counters.missing == skipped);
    RC_ASSERT(counters.duplicate == repeated);
    RC_ASSERT(counters.late == delayed);
    RC_ASSERT(counters.fresh == static_cast<std::uint64_t>(newest) + 1 - skipped);
    RC_ASSERT(counters.received == counters.fresh + counters.duplicate + counters.late);
    RC_ASSERT(counters.restarts == 0u);
  }));
}

}  // namespace
}  // namespace joulecast::telemetry
