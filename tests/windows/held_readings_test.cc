#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "tests/support/sample_robots.h"
#include "tests/windows/recordings.h"
#include "windows/windows.h"

namespace joulecast::windows {
namespace {

using signals::Sample;
using telemetry::Recording;

double speed(double t) {
  return 5 + 3 * std::sin(0.7 * t) + std::sin(1.9 * t);
}

double power_w(double speed_rad_s) {
  return 20 + 15 * std::fabs(speed_rad_s);
}

// Rows at a fixed rate. The battery is read every `period_s`; a reading is `delay_s` old.
Recording held(double seconds, double rate_hz, double period_s, double delay_s = 0) {
  return testing::recorded(static_cast<std::size_t>(seconds * rate_hz), rate_hz, [&](double t, Sample& s) {
    s.wheel_velocity_rad_s = {speed(t), speed(t)};
    s.motor_current_a = {1 + 0.1 * speed(t), 1};
    s.motor_voltage_v = {3, 3};
    const double read = period_s * std::floor(t / period_s + 1e-6);
    s.battery_voltage_v = 25;
    s.battery_current_a = power_w(speed(read - delay_s)) / 25;
  });
}

TEST(FindReadings, DetectsReadingsInEachRow) {
  const Readings r = find_readings(std::vector{held(60, 50, 0.02)});
  EXPECT_FALSE(r.held());
  EXPECT_NEAR(r.row_s, 0.02, 1e-9);
  EXPECT_NEAR(r.period_s, 0.02, 1e-9);
  EXPECT_TRUE(r.motor_currents && r.motor_voltages && r.battery_power);
}

TEST(FindReadings, IgnoresShortRepetitions) {
  const Readings r = find_readings(std::vector{held(60, 50, 0.1)});
  EXPECT_FALSE(r.held());
}

TEST(FindReadings, FindsPeriodOfHeldBattery) {
  const Readings r = find_readings(std::vector{held(300, 20, 1)});
  EXPECT_TRUE(r.battery_held);
  EXPECT_FALSE(r.motors_held);
  EXPECT_NEAR(r.period_s, 1, 1e-6);
}

TEST(FindReadings, OneHeldMissionIsIgnored) {
  EXPECT_FALSE(find_readings(std::vector{held(60, 20, 0.05), held(60, 20, 1), held(60, 20, 0.05)}).held());
  EXPECT_TRUE(find_readings(std::vector{held(60, 20, 1), held(60, 20, 0.05), held(60, 20, 1)}).held());
}

TEST(HeldWindows, UseEachReadingOnce) {
  const auto robot = testing::nomad();
  const std::vector missions{held(300, 20, 1)};
  const Readings readings = find_readings(missions);
  std::size_t count = 0;
  for (const Window& w : make_windows(missions, robot, readings)) {
    EXPECT_EQ(w.reading, !std::isnan(w.battery_power_w));
    if (!w.reading) {
      EXPECT_TRUE(std::isnan(w.battery_current_a) && std::isnan(w.battery_voltage_v));
      EXPECT_TRUE(std::isfinite(w.current_a[0]));
      continue;
    }
    EXPECT_EQ(w.continues, count > 0);
    ++count;
    // A whole second when it was read, and the motion of then; over 0.4 s a sine of 1.9 rad/s loses 1 %.
    EXPECT_NEAR(std::remainder(w.t_s, 1), 0, 1e-6);
    EXPECT_NEAR(w.battery_power_w, power_w(speed(w.t_s)), 1e-9);
    EXPECT_NEAR(power_w(w.speed_rad_s[0]), w.battery_power_w, 0.5);
    EXPECT_EQ(w.battery_power_slope_w_s, 0);
    EXPECT_TRUE(w.motors_apart);
    EXPECT_TRUE(std::isnan(w.yaw_rate_rad_s));
  }
  EXPECT_NEAR(static_cast<double>(count), 299, 1);
}

TEST(HeldWindows, UseReadingsOfHeldMotors) {
  auto mission = held(120, 20, 0.05);
  for (std::size_t k = 0; k < mission.samples.size(); ++k) {
    Sample& s = mission.samples[k];
    s.motor_current_a = mission.samples[k / 20 * 20].motor_current_a;
    s.motor_current_a[0] = k % 20 == 0 ? 1 + 0.1 * speed(static_cast<double>(k) / 20) : s.motor_current_a[0];
  }
  const auto robot = testing::nomad();
  const std::vector missions{mission};
  const Readings readings = find_readings(missions);
  EXPECT_TRUE(readings.motors_held);
  EXPECT_FALSE(readings.battery_held);
  std::size_t count = 0;
  for (const Window& w : make_windows(missions, robot, readings)) {
    EXPECT_EQ(std::isnan(w.current_a[0]), !w.reading);
    EXPECT_EQ(std::isnan(w.battery_power_w), w.reading);
    EXPECT_FALSE(w.motors_apart);
    if (!w.reading) continue;
    ++count;
    EXPECT_NEAR(w.current_a[0], 1 + 0.1 * speed(w.t_s), 1e-9);
  }
  EXPECT_NEAR(static_cast<double>(count), 118, 2);
}

TEST(HeldWindows, UseReadingsBetweenEmptyRows) {
  // Only every twentieth row has a battery reading.
  auto mission = held(120, 20, 1);
  for (std::size_t k = 0; k < mission.samples.size(); ++k) {
    if (k % 20 != 0)
      mission.samples[k].battery_voltage_v = mission.samples[k].battery_current_a = signals::unmeasured;
  }
  const auto robot = testing::nomad();
  const std::vector missions{mission};
  const Readings readings = find_readings(missions);
  EXPECT_TRUE(readings.battery_held);
  EXPECT_NEAR(readings.period_s, 1, 1e-6);
  std::size_t count = 0;
  for (const Window& w : make_windows(missions, robot, readings)) {
    if (!std::isfinite(w.battery_power_w)) continue;
    ++count;
    EXPECT_NEAR(w.battery_power_w, power_w(speed(w.t_s)), 1e-9);
  }
  EXPECT_NEAR(static_cast<double>(count), 118, 2);
}

TEST(HeldWindows, ExcludeGaps) {
  const auto robot = testing::nomad();
  const std::vector missions{testing::without(held(120, 20, 1), 50.3, 58.6)};
  const Readings readings = find_readings(missions);
  std::size_t breaks = 0;
  for (const Window& w : make_windows(missions, robot, readings)) {
    EXPECT_FALSE(w.t_s > 50.3 && w.t_s < 58.55) << w.t_s;
    breaks += w.reading && !w.continues ? 1 : 0;
  }
  EXPECT_EQ(breaks, 2u);
}

}  // namespace
}  // namespace joulecast::windows
