#include "windows/track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/sample_robots.h"
#include "tests/windows/recordings.h"

namespace joulecast::windows {
namespace {

using signals::Sample;

Track track_of(const telemetry::Recording& mission, const WindowSettings& settings = {}) {
  return make_track(mission, testing::nomad(), {}, median_period_s(mission), settings);
}

TEST(Track, ComputesTimeAndSpeed) {
  const auto mission = testing::recorded(500, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {1 + t, -2};
  });
  EXPECT_NEAR(median_period_s(mission), 0.02, 1e-12);
  const Track c = track_of(mission);
  for (std::size_t k = 0; k < 500; ++k) {
    const double t = static_cast<double>(k) / 50;
    EXPECT_NEAR(c.time_s[k], t, 1e-9);
    EXPECT_EQ(c.speed[0][k], 1 + c.time_s[k]);
    // The centred mean is exact on a line, except at the ends.
    if (k >= 2 && k < 498) {
      EXPECT_NEAR(c.smooth_speed[0][k], 1 + t, 1e-9);
    }
    EXPECT_NEAR(c.angle[0][k], t + 0.5 * t * t, 1e-8);
    EXPECT_NEAR(c.angle[1][k], -2 * t, 1e-8);
  }
}

TEST(Track, LineIsExactOnALine) {
  const std::vector<double> t{0, 0.1, 0.25, 0.4, 0.5, 2.0};
  std::vector<double> v;
  for (const double at : t) v.push_back(3 - 2 * at);
  v[2] = signals::unmeasured;
  const Line line = line_at(t, v, 0.2, 0.3);
  EXPECT_NEAR(line.value, 2.6, 1e-12);
  EXPECT_NEAR(line.slope, -2, 1e-12);
  EXPECT_TRUE(std::isnan(line_at(t, v, 2.0, 0.3).value));
}

TEST(Track, ComputesPowerAndBraking) {
  // 12 V throughout; the current is 1.5 A, after 5 s -0.5 A.
  const auto mission = testing::recorded(500, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {3, 3};
    s.motor_voltage_v = {12, 12};
    s.motor_current_a = {t < 5 ? 1.5 : -0.5, signals::unmeasured};
  });
  const Track c = track_of(mission);
  EXPECT_NEAR(c.power[0][100], 18, 1e-9);
  EXPECT_NEAR(c.power_abs[0][100], 18, 1e-9);
  EXPECT_EQ(c.braking[0][100], 0);
  EXPECT_NEAR(c.current_sign[0][100], 1, 1e-9);
  EXPECT_NEAR(c.power[0][400], -6, 1e-9);
  EXPECT_NEAR(c.power_abs[0][400], 6, 1e-9);
  EXPECT_NEAR(c.braking[0][400], 6, 1e-9);
  EXPECT_NEAR(c.current_sign[0][400], -1, 1e-9);
  EXPECT_TRUE(std::isnan(c.power[1][100]));
  EXPECT_EQ(c.current_sign[1][100], 0);
}

TEST(Track, FiltersHeatAndMotion) {
  // From nothing towards a steady value: 1 - exp(-t/T).
  const robot::RobotModel robot = testing::nomad();
  const auto mission = testing::recorded(5000, 50, [](double, Sample& s) {
    s.wheel_velocity_rad_s = {4, -2};
    s.motor_current_a = {2, signals::unmeasured};
  });
  const Track c = track_of(mission);
  const double friction_a =
      robot.motor.friction_torque_nm[1] / (robot.motor.torque_constant_nm_a * robot.motor.gear_ratio);
  for (const std::size_t k : {500u, 2500u, 4999u}) {
    const double t = static_cast<double>(k) / 50;
    for (std::size_t q = 0; q < heat_time_constants_s.size(); ++q) {
      const double grown = 1 - std::exp(-t / heat_time_constants_s[q]);
      EXPECT_NEAR(c.heat[q][0][k], 2.74 * 4 * grown, 1e-9);
      // Without a reading, the current of the nominal friction heats the winding.
      EXPECT_NEAR(c.heat[q][1][k], 2.74 * friction_a * friction_a * grown, 1e-9);
    }
    for (std::size_t q = 0; q < motion_time_constants_s.size(); ++q)
      EXPECT_NEAR(c.motion[q][k], 3 * (1 - std::exp(-t / motion_time_constants_s[q])), 1e-9);
  }
}

TEST(Track, SlideFollowsWheelAngle) {
  // At rest for 2 s, turning at 0.5 rad/s for 4 s, then backwards.
  const auto mission = testing::recorded(500, 50, [](double t, Sample& s) {
    const double speed = t < 2 ? 0 : t < 6 ? 0.5 : -0.5;
    s.wheel_velocity_rad_s = {speed, 0.5};
  });
  const Track c = track_of(mission);
  EXPECT_EQ(c.slid[0][50], 0);
  EXPECT_NEAR(c.slid[0][200], 0.5 * 2, 0.03);
  EXPECT_NEAR(c.slid[0][400], 0.5 * 2, 0.03);
  // A recording that begins in motion slides from its beginning.
  EXPECT_NEAR(c.slid[1][400], sliding_rad + 0.5 * 8, 1e-9);
}

TEST(Track, ComputesBatteryState) {
  const auto mission = testing::recorded(1000, 50, [](double t, Sample& s) {
    s.battery_voltage_v = 24 - 0.5 * std::floor(t / 5);
    s.battery_current_a = t < 10 ? 3 : signals::unmeasured;
  });
  const Track c = track_of(mission);
  EXPECT_NEAR(c.battery_power[300], 3 * 23.5, 1e-12);
  EXPECT_TRUE(std::isnan(c.battery_power[700]));
  EXPECT_NEAR(c.charge[400], 3 * 8, 1e-9);
  // No charge has been recorded since.
  EXPECT_NEAR(c.charge[999], 3 * 9.98, 1e-9);
}

TEST(Track, HeadingsDoNotJump) {
  const auto mission = testing::recorded(1000, 50, [](double t, Sample& s) {
    s.pose = {1, 2, std::remainder(0.9 * t, 2 * std::numbers::pi)};
  });
  const Track c = track_of(mission);
  for (std::size_t k = 0; k < 1000; ++k) EXPECT_NEAR(c.heading[k], 0.9 * c.time_s[k], 1e-9);
}

TEST(Track, RemovesElectricalDelay) {
  // Electrical readings are 0.03 s late; wheel speeds are not.
  const auto mission = testing::recorded(500, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {t, t};
    s.motor_voltage_v = {2 * (t - 0.03), 0};
    s.motor_current_a = {t - 0.03, 0};
    s.battery_voltage_v = 24 + (t - 0.03);
    s.battery_current_a = 5 * (t - 0.03);
  });
  WindowSettings settings;
  settings.electrical_delay_s = 0.03;
  const Track c = track_of(mission, settings);
  for (std::size_t k = 0; k < 495; ++k) {
    const double t = c.time_s[k];
    EXPECT_NEAR(c.speed[0][k], t, 1e-12);
    EXPECT_NEAR(c.voltage[0][k], 2 * t, 1e-9);
    EXPECT_NEAR(c.current[0][k], t, 1e-9);
    EXPECT_NEAR(c.battery_voltage[k], 24 + t, 1e-9);
    EXPECT_NEAR(c.battery_current[k], 5 * t, 1e-9);
  }
}

TEST(Track, PayloadKeepsLastReport) {
  auto mission =
      testing::recorded(500, 50, [](double t, Sample& s) { s.payload_kg = t > 5 ? 4 : signals::unmeasured; });
  EXPECT_EQ(track_of(mission).payload[100], 0);
  mission.payload_kg = 2;
  const Track c = track_of(mission);
  EXPECT_EQ(c.payload[100], 2);
  EXPECT_EQ(c.payload[400], 4);
}

TEST(Track, ClimbFollowsPitchOrHeight) {
  // 0.4 m/s up a slope of 5 %.
  auto mission = testing::recorded(1000, 50, [](double, Sample& s) { s.wheel_velocity_rad_s = {4, 4}; });
  EXPECT_TRUE(std::isnan(track_of(mission).climb[500]));
  signals::CovariateSeries height{.name = "height_m", .utime_us = {}, .value = {}};
  for (const Sample& s : mission.samples) {
    height.utime_us.push_back(s.utime_us);
    height.value.push_back(0.05 * 0.4 * 1e-6 * static_cast<double>(s.utime_us - testing::start_us));
  }
  mission.covariates = {height};
  EXPECT_NEAR(track_of(mission).climb[500], std::asin(0.05), 1e-6);
  for (Sample& s : mission.samples) s.pitch_rad = -0.02;
  EXPECT_NEAR(track_of(mission).climb[500], -0.02, 1e-12);
}

}  // namespace
}  // namespace joulecast::windows
