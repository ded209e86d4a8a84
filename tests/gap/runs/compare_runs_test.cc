#include <gtest/gtest.h>

#include <algorithm>

#include "gap/groups/compare.h"
#include "made_runs.h"

namespace joulecast::gap {
namespace {

using testing::Departure;

// Runs that alternate between two groups, each with a separate departure from the robot file.
RunSet two_groups(const Departure& one, const Departure& other, std::size_t runs, double scatter,
                  unsigned seed, const robot::RobotModel& robot = testing::nomad()) {
  std::mt19937_64 random(seed);
  RunSet set;
  set.labels = {"surface"};
  for (std::size_t k = 0; k < runs; ++k) {
    const bool second = k % 2 == 1;
    set.runs.push_back(testing::made(robot, testing::drawn(random), second ? other : one, scatter, random));
    set.runs.back().labels = {second ? "carpet" : "hard"};
  }
  return set;
}

Comparison compared(const RunSet& set, const robot::RobotModel& robot = testing::nomad()) {
  const auto groups = set.groups_by("surface");
  EXPECT_TRUE(groups);
  auto comparison = compare_runs(set, *groups, robot);
  EXPECT_TRUE(comparison) << (comparison ? "" : describe(comparison.error()));
  return *comparison;
}

std::vector<std::string> group_of(const DiagnosedEffect& e) {
  std::vector<std::string> group = e.alternatives;
  group.push_back(e.id);
  return group;
}

TEST(CompareRuns, FindsFrictionOfSurface) {
  const Comparison c = compared(two_groups({}, {.friction_nm = 0.3}, 48, 0.01, 5));
  ASSERT_EQ(c.diagnosis.effects.size(), 1u);
  const DiagnosedEffect& e = c.diagnosis.effects.front();
  EXPECT_EQ(std::ranges::count(group_of(e), "coulomb_friction"), 1) << e.id;
  EXPECT_EQ(c.diagnosis.verdict, Verdict::effects) << name_of(c.diagnosis.verdict);
  EXPECT_LT(c.diagnosis.baseline->explanation_held_out, 0.6 * c.diagnosis.baseline->unchanged_model_held_out);
  // 0.3 N m at each wheel of 0.1 m costs 6 J/m of mechanical energy, divided by the motors' efficiency. The
  // rest of the difference comes from the random conditions of the runs.
  ASSERT_TRUE(c.difference);
  EXPECT_EQ(c.difference->to, "carpet");
  EXPECT_GT(c.difference->by_effect_j.front().second, 6.0);
  EXPECT_LT(std::abs(c.difference->unexplained_j), 0.35 * c.difference->energy_per_m_j);
  if (e.id == "coulomb_friction") {
    // In units of the file's friction, the mean of both sides.
    EXPECT_NEAR(e.parameters.front().value, 0.3 / 0.3594, 3 * e.parameters.front().deviation);
  }
}

// Energies of whole runs barely distinguish driver loss from friction or a weaker magnet. The reported group
// contains driver loss in most cases, and no other effect has a high probability.
TEST(CompareRuns, FindsDriverLossOrEquivalent) {
  robot::RobotModel robot = testing::nomad();
  robot.idle_power_w = 1;
  int right = 0;
  for (const unsigned seed : {6u, 7u, 8u, 9u}) {
    const Comparison c = compared(two_groups({}, {.driver_loss = 0.4}, 80, 0.01, seed, robot), robot);
    ASSERT_FALSE(c.diagnosis.effects.empty());
    const DiagnosedEffect& e = c.diagnosis.effects.front();
    const bool there = std::ranges::count(group_of(e), "driver_loss") > 0;
    right += there ? 1 : 0;
    EXPECT_TRUE(there || e.probability < 0.9) << e.id;
    EXPECT_GT(c.difference->by_effect_j.front().second, 0);
  }
  EXPECT_GE(right, 3);
}

TEST(CompareRuns, FindsLoadOfGroup) {
  const Comparison c = compared(two_groups({.load_w = 3}, {.load_w = 9}, 40, 0.02, 7));
  ASSERT_EQ(c.diagnosis.effects.size(), 1u);
  const DiagnosedEffect& e = c.diagnosis.effects.front();
  EXPECT_EQ(std::ranges::count(group_of(e), "accessory_load"), 1) << e.id;
  if (e.id == "accessory_load") {
    EXPECT_NEAR(e.parameters.front().value, 6, 1.5);
  }
  // Relative to the mean of both groups there is no gap and no common cause.
  EXPECT_LT(std::abs(c.diagnosis.energy_relative), 0.02);
  EXPECT_TRUE(c.common.empty());
  EXPECT_LT(c.diagnosis.baseline->explanation_held_out, 0.5 * c.diagnosis.baseline->unchanged_model_held_out);
}

// A load that is in both groups and absent from the robot file is not attributed to the difference.
TEST(CompareRuns, FindsFrictionUnderCommonLoad) {
  const Comparison c = compared(two_groups({.load_w = 6}, {.friction_nm = 0.3, .load_w = 6}, 48, 0.01, 5));
  ASSERT_EQ(c.diagnosis.effects.size(), 1u);
  const DiagnosedEffect& e = c.diagnosis.effects.front();
  EXPECT_EQ(std::ranges::count(group_of(e), "coulomb_friction"), 1) << e.id;
  EXPECT_EQ(name_of(c.diagnosis.verdict), "effects");
  EXPECT_LT(c.diagnosis.baseline->explanation_held_out, 0.6 * c.diagnosis.baseline->unchanged_model_held_out);
  ASSERT_TRUE(c.difference);
  EXPECT_LT(std::abs(c.difference->unexplained_j), 0.35 * c.difference->energy_per_m_j);
  EXPECT_FALSE(c.common.empty());
}

TEST(CompareRuns, ReturnsNothingForEqualGroups) {
  std::size_t named = 0;
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Comparison c = compared(two_groups({.load_w = 3}, {.load_w = 3}, 40, 0.02, seed));
    named += c.diagnosis.effects.size();
  }
  EXPECT_EQ(named, 0u);
}

TEST(CompareRuns, NamesLabelInErrors) {
  RunSet set = two_groups({}, {}, 8, 0.02, 1);
  EXPECT_EQ(describe(set.groups_by("driver").error()),
            "--compare-by: driver is no label of these runs; they have table, surface");
  for (MissionRun& run : set.runs) run.labels = {"hard"};
  const auto groups = set.groups_by("surface");
  ASSERT_TRUE(groups);
  EXPECT_EQ(describe(compare_runs(set, *groups, testing::nomad()).error()),
            "--compare-by: gives one group only; two are needed to compare");
}

}  // namespace
}  // namespace joulecast::gap
