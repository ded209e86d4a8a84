#include "gap/windows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "gap/channels.h"
#include "tests/support/sample_robots.h"

namespace joulecast::gap {
namespace {

// A mission in which both wheels speed up steadily and the drive obeys the nominal model.
telemetry::RecordingSet steady_ramp(const robot::RobotModel& robot, double rate_hz, bool motors) {
  const dynamics::DriveModel model(robot, {});
  telemetry::Recording mission;
  mission.mission_id = "ramp";
  mission.payload_kg = 2;
  for (int k = 0; k < static_cast<int>(20 * rate_hz); ++k) {
    const double t = k / rate_hz;
    dynamics::Instant at;
    at.wheel_speed_rad_s = {1 + 0.2 * t, 1 + 0.15 * t};
    at.wheel_acceleration_rad_s2 = {0.2, 0.15};
    at.payload_kg = 2;
    const auto flow = model.flow(at);
    telemetry::Sample s;
    s.utime_us = 1'000'000 + static_cast<std::int64_t>(std::llround(1e6 * t));
    s.sequence = k;
    s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    if (motors) {
      s.motor_voltage_v = flow.voltage_v;
      s.motor_current_a = flow.current_a;
    }
    s.battery_voltage_v = robot.battery.nominal_voltage_v;
    s.battery_current_a = flow.battery_power_w / robot.battery.nominal_voltage_v;
    s.payload_kg = 2;
    mission.samples.push_back(s);
  }
  return *telemetry::make_recording_set(robot.robot_id, {mission});
}

class AnyRate : public ::testing::TestWithParam<double> {};

TEST_P(AnyRate, AveragesAndSlopesAreExactOnStraightLines) {
  const auto robot = testing::nomad();
  const auto windows = make_windows(steady_ramp(robot, GetParam(), true), robot);
  ASSERT_GT(windows.size(), 10u);
  for (const Window& w : windows) {
    EXPECT_NEAR(w.acceleration_rad_s2[0], 0.2, 1e-9);
    EXPECT_NEAR(w.acceleration_rad_s2[1], 0.15, 1e-9);
    EXPECT_TRUE(w.moving[0] && w.moving[1]);
    EXPECT_TRUE(std::isnan(w.yaw_rate_rad_s));
  }
}

TEST_P(AnyRate, TheModelLeavesNoResidualOfItself) {
  const auto robot = testing::nomad();
  const dynamics::DriveModel model(robot, {});
  for (const bool motors : {true, false}) {
    for (const Window& w : make_windows(steady_ramp(robot, GetParam(), motors), robot)) {
      const auto r = residuals(model, w, true);
      for (const Channel c : {Channel::voltage_right, Channel::torque_left}) {
        if (motors) {
          // Dry friction fades as (width/speed)^2/2; its curvature over a window leaves below 1e-8.
          EXPECT_NEAR(r[index_of(c)], 0, 1e-8);
        } else {
          EXPECT_TRUE(std::isnan(r[index_of(c)]));
        }
      }
      // Power is quadratic in a speed that changes by 0.2 x 0.4 s (longer for slow recordings) over a window:
      // its mean differs from the power of the mean by less than its curvature times that squared.
      EXPECT_NEAR(r[index_of(Channel::power)], 0, 0.05);
      EXPECT_TRUE(std::isnan(r[index_of(Channel::gyro)]));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, AnyRate, ::testing::Values(10.0, 50.0, 200.0));

// A wheel that starts from rest; one side only, so that the other stays at rest.
telemetry::RecordingSet start_from_rest(const robot::RobotModel& robot) {
  telemetry::Recording mission;
  mission.mission_id = "start";
  for (int k = 0; k < 500; ++k) {
    const double t = k / 50.0;
    telemetry::Sample s;
    s.utime_us = 1'000'000 + 20'000 * k;
    s.sequence = k;
    s.wheel_velocity_rad_s = {t > 2 ? 0.3 * (t - 2) : 0.0, 0};
    s.motor_current_a = {0.4, 0};
    s.battery_voltage_v = k % 2 == 0 ? 24.0 : 24.5;
    mission.samples.push_back(s);
  }
  return *telemetry::make_recording_set(robot.robot_id, {mission});
}

TEST(Windows, AWheelSlidesOnceItsContactsHaveBent) {
  const auto robot = testing::nomad();
  for (const Window& w : make_windows(start_from_rest(robot), robot)) {
    EXPECT_FALSE(w.moving[1]);
    // 0.15 rad/s^2 (t - 2)^2 turned: a tenth of a radian after 0.82 s.
    if (w.t_s < 2.8) {
      EXPECT_FALSE(w.moving[0]) << w.t_s;
    }
    if (w.t_s > 3.2) {
      EXPECT_TRUE(w.moving[0]) << w.t_s;
    }
  }
}

TEST(Windows, PartsMakeUpTheMean) {
  const auto robot = testing::nomad();
  for (const Window& w : make_windows(start_from_rest(robot), robot)) {
    double weight = 0, mean = 0;
    for (std::size_t part = 0; part < w.part_weight.size(); ++part) {
      weight += w.part_weight[part];
      mean += w.part_weight[part] * w.part_speed_rad_s[part][0];
    }
    EXPECT_NEAR(weight, 1, 1e-12);
    EXPECT_NEAR(mean, w.speed_rad_s[0], 1e-12);
    EXPECT_LE(w.part_speed_rad_s[0][0], w.part_speed_rad_s[2][0]);
  }
}

TEST(Windows, JudgeTheSignOfACurrentWithoutItsBias) {
  const auto robot = testing::nomad();
  WindowSettings settings;
  EXPECT_GT(make_windows(start_from_rest(robot), robot, settings).back().current_sign[0], 0.5);
  settings.motor_current_bias_a = 0.8;
  EXPECT_LT(make_windows(start_from_rest(robot), robot, settings).back().current_sign[0], -0.5);
}

TEST(Windows, KnowTheStepOfACoarseConverter) {
  const auto robot = testing::nomad();
  EXPECT_DOUBLE_EQ(make_windows(start_from_rest(robot), robot).front().battery_voltage_step_v, 0.5);
}

TEST(Windows, RememberHowMuchTheRobotMoved) {
  const auto robot = testing::nomad();
  const auto windows = make_windows(start_from_rest(robot), robot);
  EXPECT_EQ(windows.front().recent_rad_s[0], 0);
  for (std::size_t k = 1; k < windows.size(); ++k) {
    EXPECT_GE(windows[k].recent_rad_s[0], windows[k - 1].recent_rad_s[0]);
    // The shorter memory follows closer.
    EXPECT_GE(windows[k].recent_rad_s[0], windows[k].recent_rad_s[2]);
  }
  EXPECT_GT(windows.back().recent_rad_s[0], 0.3);
}

}  // namespace
}  // namespace joulecast::gap
