#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "telemetry/codec.h"
#include "telemetry/log_recordings.h"
#include "temporary_file.h"

namespace joulecast::telemetry {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t second_us = 1'000'000;

Recording mission(const std::string& id, double start_s, double length_s, double payload_kg = 0,
                  const std::string& robot = "a") {
  Recording made{robot, id, payload_kg, {}};
  for (double t = 0; t <= length_s + 1e-9; t += 0.1) {
    signals::Sample sample;
    sample.utime_us = std::llround((start_s + t) * 1e6);
    sample.sequence = static_cast<std::int64_t>(made.samples.size());
    sample.wheel_velocity_rad_s = {3, 3};
    sample.payload_kg = payload_kg;
    made.samples.push_back(sample);
  }
  return made;
}

std::vector<std::string> names_of(const RecordingSet& set) {
  std::vector<std::string> names;
  for (const Recording& m : set.missions) names.push_back(m.mission_id);
  return names;
}

class Log {
 public:
  Log() : writer_(EventLogWriter::create(file_.path()).value()) {}
  void add(const Recording& recording) { ASSERT_TRUE(write_recording(writer_, recording)); }
  void add(const std::string& robot, const signals::Sample& sample) {
    const auto bytes = encode_telemetry(robot, sample);
    ASSERT_TRUE(bytes);
    put(channel_of(Subject::telemetry, robot), *bytes);
  }
  void put(const std::string& channel, const std::vector<std::uint8_t>& bytes) {
    ASSERT_TRUE(writer_.write(0, channel, bytes));
  }
  Result<RecordingSet> load(const std::string& robot_id = {}) {
    EXPECT_TRUE(writer_.close());
    return load_recordings({&file_.path(), 1}, robot_id);
  }

 private:
  test::TemporaryFile file_;
  EventLogWriter writer_;
};

TEST(RecordingSet, RequiresOneRobot) {
  Log log;
  log.add(mission("m1", 10, 20, 0, "a"));
  log.add(mission("m1", 12, 30, 0, "b"));
  log.add(mission("m2", 60, 25, 0, "a"));
  log.put("ENERGY_STATE.c", {1, 2, 3});  // the daemon's messages about a robot are not telemetry
  const auto one = log.load("a");
  ASSERT_TRUE(one) << describe(one.error());
  EXPECT_EQ(one->robot_id, "a");
  EXPECT_THAT(names_of(*one), ElementsAre("m1", "m2"));
  EXPECT_EQ(one->samples, one->missions[0].samples.size() + one->missions[1].samples.size());
  EXPECT_THAT(one->notes, IsEmpty());
  const auto any = log.load();
  ASSERT_FALSE(any);
  EXPECT_THAT(describe(any.error()), AllOf(HasSubstr("2 robots, a, b"), HasSubstr("--robot-id")));
  const auto other = log.load("c");
  ASSERT_FALSE(other);
  EXPECT_THAT(describe(other.error()), HasSubstr("no telemetry of c, only of a, b"));
}

TEST(RecordingSet, DetectsUndeclaredMissions) {
  Log log;
  for (const signals::Sample& s : mission("", 10, 20).samples) log.add("a", s);
  for (const signals::Sample& s : mission("", 200, 8).samples) log.add("a", s);
  const auto set = log.load();
  ASSERT_TRUE(set) << describe(set.error());
  EXPECT_THAT(names_of(*set), ElementsAre("implicit-10000000", "implicit-200000000"));
  for (const Recording& m : set->missions) EXPECT_TRUE(m.implicit);
}

TEST(RecordingSet, CountsUnreadableMessages) {
  Log log;
  log.put("ROBOT_TELEMETRY.a", {1, 2, 3});
  const Recording good = mission("m1", 10, 20);
  signals::Sample odd = good.samples[50];
  odd.utime_us = -1;
  log.add("a", odd);
  odd.utime_us = std::int64_t{1} << 62;  // 146 millennia; it would end every mission and begin one
  log.add("a", odd);
  odd = good.samples[50];
  odd.wheel_velocity_rad_s[0] = 1e9;
  log.add("a", odd);
  log.add(good);
  odd = good.samples.back();
  odd.utime_us += 200'000;  // the mission is over, and another cannot begin this soon
  log.add("a", odd);
  const auto set = log.load();
  ASSERT_TRUE(set) << describe(set.error());
  EXPECT_THAT(names_of(*set), ElementsAre("m1"));
  EXPECT_EQ(set->missions[0].samples.size(), good.samples.size());
  EXPECT_EQ(set->unreadable, 4u);
  EXPECT_THAT(set->notes,
              ElementsAre(AllOf(HasSubstr("4 messages or values"), HasSubstr("an impossible wheel_velocity")),
                          HasSubstr("1 samples before")));
}

TEST(RecordingSet, ReportsClockFaultsWithoutMissions) {
  const Recording good = mission("m1", 1.7e9, 30);
  const auto loaded = [&](auto&& stamp) {
    Log log;
    for (signals::Sample s : good.samples) {
      s.utime_us = stamp(s.utime_us);
      log.add("a", s);
    }
    return log.load();
  };
  for (const std::int64_t divisor : {1'000, 1'000'000}) {
    const auto set = loaded([&](std::int64_t utime_us) { return utime_us / divisor; });
    ASSERT_FALSE(set);
    EXPECT_EQ(set.error().field, "utime");
    EXPECT_THAT(set.error().message, HasSubstr("in ms or s?")) << divisor;
  }
  const auto set = loaded([](std::int64_t utime_us) { return 1000 * utime_us; });
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().field, "utime");
  EXPECT_THAT(set.error().message, HasSubstr("301 samples have an impossible utime"));
}

TEST(RecordingSet, SortsSamples) {
  Log log;
  Recording made = mission("m1", 10, 20);
  std::swap(made.samples[70], made.samples[71]);
  made.samples.insert(made.samples.begin() + 30, made.samples[30]);
  log.add(made);
  const auto set = log.load();
  ASSERT_TRUE(set) << describe(set.error());
  EXPECT_EQ(set->unreadable, 1u);
  ASSERT_EQ(set->missions[0].samples.size(), made.samples.size() - 1);
  EXPECT_TRUE(std::ranges::is_sorted(set->missions[0].samples, std::ranges::less_equal{},
                                     &signals::Sample::utime_us));

  const auto in_memory = make_recording_set("a", {made});
  ASSERT_TRUE(in_memory);
  EXPECT_EQ(in_memory->missions[0].samples.size(), made.samples.size() - 1);
  EXPECT_THAT(in_memory->notes, ElementsAre(HasSubstr("1 samples have the time of another")));
}

TEST(RecordingSet, JoinsConsecutiveShortMissions) {
  std::vector<Recording> missions{mission("long", 0, 20),      mission("s1", 30, 3),
                                  mission("s2", 40, 3),        mission("s3", 50, 4),
                                  mission("loaded", 60, 3, 5), mission("last", 70, 20)};
  missions[1].covariates = {{"load", {30 * second_us}, {0.5}}};
  missions[3].covariates = {{"load", {50 * second_us}, {0.7}}};
  const auto set = make_recording_set("a", missions);
  ASSERT_TRUE(set) << describe(set.error());
  EXPECT_THAT(names_of(*set), ElementsAre("long", "s1", "last"));
  const Recording& joined = set->missions[1];
  EXPECT_EQ(joined.samples.size(),
            missions[1].samples.size() + missions[2].samples.size() + missions[3].samples.size());
  ASSERT_EQ(joined.covariates.size(), 1u);
  EXPECT_THAT(joined.covariates[0].value, ElementsAre(0.5, 0.7));
  EXPECT_THAT(set->notes,
              ElementsAre(HasSubstr("missions s1, s2, s3 last less than 5 s each and were joined"),
                          HasSubstr("mission loaded lasts 3 s, less than 5 s, and was left out")));
}

// An undeclared payload is the same in each mission.
TEST(RecordingSet, JoinsMissionsWithUnknownPayload) {
  const auto set = make_recording_set(
      "a", {mission("s1", 0, 3, signals::unmeasured), mission("s2", 10, 3, signals::unmeasured)});
  ASSERT_TRUE(set) << describe(set.error());
  EXPECT_THAT(names_of(*set), ElementsAre("s1"));
}

TEST(RecordingSet, ListsFewOfManyNames) {
  std::vector<Recording> missions;
  for (int k = 0; k < 6; ++k) missions.push_back(mission("s" + std::to_string(k), 10 * k, 2));
  missions.push_back(mission("empty", 100, 2));
  missions.back().samples.clear();
  missions.push_back(mission("long", 110, 20));
  missions.back().samples[5].wheel_velocity_rad_s[1] = signals::unmeasured;
  const auto set = make_recording_set("a", missions);
  ASSERT_TRUE(set) << describe(set.error());
  EXPECT_THAT(set->notes, ElementsAre(HasSubstr("mission empty contains no motion"),
                                      HasSubstr("1 samples without wheel speeds"),
                                      HasSubstr("missions s0, s1, s2 and 3 more")));
}

TEST(RecordingSet, RequiresAnInformativeMission) {
  const auto set = make_recording_set("a", {mission("m1", 0, 2), mission("m2", 10, 2, 5)});
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().fault, Fault::invalid);
  EXPECT_THAT(describe(set.error()), HasSubstr("no mission of at least 5 s"));
  const test::TemporaryFile empty;
  const auto log = load_recordings({&empty.path(), 1});
  ASSERT_FALSE(log);
  EXPECT_THAT(describe(log.error()), HasSubstr("is not an LCM event log, or is empty"));
}

}  // namespace
}  // namespace joulecast::telemetry
