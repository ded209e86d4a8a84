// Battery power by a model, or by a linear function of motion that no model contains.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "energy/power_windows.h"
#include "tests/support/robots.h"

namespace joulecast::energy {
namespace {

using ::testing::HasSubstr;

// Two minutes of speeds that rise and fall; `power_w` of speed and acceleration of either wheel.
telemetry::Recording compared_drive(const robot::RobotModel& robot, double phase,
                                    const std::function<double(const dynamics::Instant&)>& power_w) {
  telemetry::Recording mission{robot.robot_id, "drive", 0, {}};
  for (int k = 0; k < 6000; ++k) {
    const double t = 0.02 * k;
    dynamics::Instant at;
    for (const std::size_t side : {0u, 1u}) {
      const double turn = (side == 0 ? 1 : -1) * std::sin(0.11 * t + phase);
      at.wheel_speed_rad_s[side] = 6 + 2 * std::sin(0.3 * t + phase) + turn;
      at.wheel_acceleration_rad_s2[side] =
          0.6 * std::cos(0.3 * t + phase) + (side == 0 ? 0.11 : -0.11) * std::cos(0.11 * t + phase);
    }
    signals::Sample s;
    s.utime_us = 1'000'000 + 20'000LL * k;
    s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    s.battery_voltage_v = 24;
    s.battery_current_a = power_w(at) / 24;
    s.payload_kg = 0;
    mission.samples.push_back(s);
  }
  return mission;
}

struct Robots {
  robot::RobotModel file = samples::nomad(), truth = file;
  Robots() {
    for (double& friction : truth.motor.friction_torque_nm) friction *= 1.5;
  }
};

TEST(RegressionComparison, TrueModelBeatsRegression) {
  const Robots robots;
  const auto model = dynamics::drive_model(robots.truth).value();
  const auto power_w = [&](const dynamics::Instant& at) { return model.flow(at).battery_power_w; };
  const std::vector learnt{compared_drive(robots.file, 0, power_w)},
      tested{compared_drive(robots.file, 1, power_w)};
  const auto found = compare_with_regression(learnt, tested, robots.file, robots.truth);
  ASSERT_TRUE(found) << describe(found.error());
  EXPECT_GT(found->windows, 100u);
  EXPECT_LT(found->missed.corrected, 0.005);
  EXPECT_GT(found->missed.file, 0.05);
  EXPECT_FALSE(found->missed.regression_wins());
}

TEST(RegressionComparison, RegressionWinsOnRegressionPower) {
  const Robots robots;
  const double r = robots.file.kinematics.wheel_radius_m;
  const auto power_w = [&](const dynamics::Instant& at) {
    const auto [right, left] = at.wheel_speed_rad_s;
    return 200 - 20 * r * (right + left) / 2 + 30 * r * std::fabs(right - left);
  };
  const std::vector learnt{compared_drive(robots.file, 0, power_w)},
      tested{compared_drive(robots.file, 1, power_w)};
  const auto found = compare_with_regression(learnt, tested, robots.file, robots.truth);
  ASSERT_TRUE(found) << describe(found.error());
  EXPECT_LT(found->missed.regression, 0.01);
  EXPECT_GT(found->missed.corrected, 0.1);
  EXPECT_TRUE(found->missed.regression_wins());
}

// A lead within its standard error is a tie.
TEST(RegressionComparison, EqualErrorsAreATie) {
  MissedPower tie{0.01, 0.0043, 0.0040, 0.0005};
  EXPECT_FALSE(tie.regression_wins());
  tie.lead_sd = 0.0002;
  EXPECT_TRUE(tie.regression_wins());
}

TEST(RegressionComparison, NamesTheMissingData) {
  const Robots robots;
  const auto unknown = [](const dynamics::Instant&) { return std::nan(""); };
  const std::vector missions{compared_drive(robots.file, 0, unknown)};
  const auto found = compare_with_regression(missions, missions, robots.file, robots.truth);
  ASSERT_FALSE(found);
  EXPECT_THAT(describe(found.error()), HasSubstr("battery_current"));
}

}  // namespace
}  // namespace joulecast::energy
