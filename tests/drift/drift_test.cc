#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "drift/marks.h"
#include "drift/siblings.h"

namespace joulecast::drift {
namespace {

std::vector<MissionRatio> series(std::uint64_t seed, const std::vector<double>& levels, std::size_t each,
                                 double scatter = 0.01) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, scatter);
  std::vector<MissionRatio> missions;
  for (const double level : levels)
    for (std::size_t k = 0; k < each; ++k) {
      const auto n = static_cast<std::int64_t>(missions.size());
      missions.push_back({n + 1, n * 1'000'000, 1, 1000 * (level + noise(random)), 1000});
    }
  return missions;
}

TEST(Drift, MarksWhereTheRatioChanges) {
  const auto marks = find_marks(series(1, {1.0, 1.05, 1.02}, 20), {});
  ASSERT_EQ(marks.size(), 2U);
  EXPECT_NEAR(static_cast<double>(marks[0].mission_key), 21, 1);
  EXPECT_NEAR(marks[0].before, 1.0, 0.01);
  // Of the three missions that reveal it: two standard errors.
  EXPECT_NEAR(marks[0].after, 1.05, 2 * 0.01 / std::sqrt(3.0));
  EXPECT_LT(marks[0].interval[0], 0.05);
  EXPECT_GT(marks[0].interval[1], 0.05);
  EXPECT_NEAR(static_cast<double>(marks[1].mission_key), 41, 2);
  EXPECT_GE(marks[1].missions, 18U);
}

// As looked at after each mission.
TEST(Drift, SteadyMissionsRaiseNoAlarm) {
  int alarms = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed)
    alarms += !find_marks(series(seed, {1.03}, 60, 0.02), {}).empty();
  // The nominal rate is 1 %: 400 trials of a binomial have a 99.9 % upper limit of 11.
  EXPECT_LE(alarms, 11);
}

TEST(Drift, LaterMissionsMoveNoMark) {
  const auto missions = series(7, {1.0, 1.04, 1.08}, 15);
  std::vector<Mark> before;
  for (std::size_t n = 1; n <= missions.size(); ++n) {
    const auto marks = find_marks(std::span(missions).first(n), {});
    ASSERT_GE(marks.size(), before.size());
    for (std::size_t k = 0; k < before.size(); ++k) {
      EXPECT_EQ(marks[k].mission_key, before[k].mission_key);
      EXPECT_EQ(marks[k].after, before[k].after);
    }
    before = marks;
  }
  EXPECT_EQ(before.size(), 2U);
}

TEST(Drift, OneChangeIsOneMark) {
  auto missions = series(8, {1.0, 1.06}, 12);
  for (std::size_t k = 0; k < missions.size(); ++k) missions[k].mass = k < 12 ? 1.0 : 1.2;
  const auto marks = find_marks(missions, {});
  ASSERT_EQ(marks.size(), 1U);
  EXPECT_EQ(marks[0].quantity, Quantity::mass);
  EXPECT_EQ(marks[0].mission_key, 13);
  EXPECT_NEAR(marks[0].change(), 0.2, 1e-9);
}

TEST(Drift, DetectsGrowingWear) {
  int seen = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    auto missions = series(seed, {1.0}, 60, 0.01);
    for (std::size_t k = 0; k < missions.size(); ++k) missions[k].measured_j += 1.0 * static_cast<double>(k);
    seen += !find_marks(missions, {}).empty();
  }
  EXPECT_EQ(seen, 50);
}

TEST(Drift, AdoptedModelIsNoDrift) {
  auto missions = series(3, {1.1, 1.0}, 20);
  for (std::size_t k = 20; k < missions.size(); ++k) missions[k].model_version = 2;
  EXPECT_TRUE(find_marks(missions, {}).empty());
}

TEST(Drift, OmitsUnmeasuredMissions) {
  auto missions = series(4, {1.0}, 20);
  for (std::size_t k = 10; k < 15; ++k) missions[k].measured_j = 0;
  EXPECT_TRUE(find_marks(missions, {}).empty());
  EXPECT_TRUE(find_marks({}, {}).empty());
}

TEST(Drift, MarksDeviatingSibling) {
  std::vector<RobotRatios> robots;
  for (int k = 0; k < 6; ++k)
    robots.push_back({std::string("r").append(std::to_string(k)),
                      series(static_cast<std::uint64_t>(10 + k), {k == 4 ? 1.12 : 1.0 + 0.003 * k}, 20)});
  robots.push_back({"young", series(5, {1.3}, 2)});
  const auto siblings = compare_siblings(robots, {});
  ASSERT_EQ(siblings.size(), 6U);
  for (const auto& s : siblings) {
    EXPECT_EQ(s.stands_out, s.robot_id == "r4") << s.robot_id << " " << s.deviation;
    EXPECT_LE(s.interval[0], s.ratio);
    EXPECT_GE(s.interval[1], s.ratio);
  }
  robots.resize(2);
  robots[0].missions = series(9, {1.5}, 20);
  EXPECT_TRUE(std::ranges::none_of(compare_siblings(robots, {}), &SiblingRatio::stands_out));
}

}  // namespace
}  // namespace joulecast::drift
