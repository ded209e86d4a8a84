#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "gap/groups/compare.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap {
namespace {

namespace vr = virtual_robot;

// Missions alternate between groups A and B and contain battery power and motion only. B draws more power.
Comparison compared(const std::function<double(const signals::Sample&, const robot::RobotModel&)>& more_w) {
  made::Robot robot = made::virtual_robot(vr::shipped_robots()[1].kind, 23, [](vr::SimulationSpec& spec) {
    const vr::SimulationSpec usual;
    spec.script = usual.script;
    spec.rate_hz = usual.rate_hz;
    spec.missions = 8;
    spec.sensors.motor_channels = false;
  });
  std::vector<std::string> groups;
  for (std::size_t m = 0; m < robot.recordings.missions.size(); ++m) {
    groups.emplace_back(m % 2 == 0 ? "A" : "B");
    if (m % 2 == 0) continue;
    for (signals::Sample& s : robot.recordings.missions[m].samples)
      s.battery_current_a += more_w(s, robot.model) / s.battery_voltage_v;
  }
  const auto comparison = compare_recordings(robot.recordings, groups, robot.model);
  EXPECT_TRUE(comparison) << (comparison ? "" : describe(comparison.error()));
  return *comparison;
}

void expect_floor_without_the_difference(const Comparison& c) {
  EXPECT_LT(c.diagnosis.noise_floor, 0.025);
}

TEST(CompareRecordings, FindsLoadOfGroup) {
  const Comparison c = compared([](const auto&, const auto&) { return 8.0; });
  const Diagnosis& d = c.diagnosis;
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "accessory_load");
  EXPECT_EQ(name_of(d.verdict), "effects");
  EXPECT_NEAR(d.effects[0].parameters.front().value, 8, 0.5);
  EXPECT_LT(d.baseline->explanation_held_out, 0.4 * d.baseline->unchanged_model_held_out);
  // Relative to the mean of both groups there is no gap and no common cause.
  EXPECT_LT(std::fabs(d.energy_relative), 0.02);
  EXPECT_TRUE(c.common.empty()) << c.common.front();
  expect_floor_without_the_difference(c);
}

// A force that bypasses the motors matches no effect exactly; friction is the nearest.
TEST(CompareRecordings, NamesEffectNearestToDifference) {
  const Comparison c = compared([](const signals::Sample& s, const robot::RobotModel& robot) {
    return 6 * robot.kinematics.wheel_radius_m *
           std::fabs(s.wheel_velocity_rad_s[0] + s.wheel_velocity_rad_s[1]);
  });
  const Diagnosis& d = c.diagnosis;
  ASSERT_FALSE(d.effects.empty());
  EXPECT_TRUE(std::ranges::any_of(d.effects, [](const DiagnosedEffect& e) {
    return e.id == "coulomb_friction" || std::ranges::count(e.alternatives, "coulomb_friction") > 0;
  }));
  EXPECT_LT(d.baseline->explanation_held_out, 0.6 * d.baseline->unchanged_model_held_out);
  expect_floor_without_the_difference(c);
}

TEST(CompareRecordings, ReturnsNothingForEqualGroups) {
  const Comparison c = compared([](const auto&, const auto&) { return 0.0; });
  EXPECT_TRUE(c.diagnosis.effects.empty());
  EXPECT_EQ(name_of(c.diagnosis.verdict), "none");
}

}  // namespace
}  // namespace joulecast::gap
