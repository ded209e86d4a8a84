#include <gtest/gtest.h>

#include <cmath>

#include "gap/diagnose/recordings.h"

namespace joulecast::gap {
namespace {

// Rows of 0.1 s with a battery current [A] of 10 times the time [s].
telemetry::Recording rows(std::size_t count) {
  telemetry::Recording mission;
  for (std::size_t k = 0; k < count; ++k) {
    signals::Sample s;
    s.utime_us = 1'000'000'000'000'000 + static_cast<std::int64_t>(k) * 100'000;
    s.battery_voltage_v = 24 + 0.1 * static_cast<double>(k);
    s.battery_current_a = static_cast<double>(k);
    s.motor_current_a = {static_cast<double>(k), 0};
    mission.samples.push_back(s);
  }
  return mission;
}

TEST(MoveBatteryBack, InterpolatesLaterReadings) {
  telemetry::Recording mission = rows(20);
  move_back(mission, 0.25, true);
  for (std::size_t k = 0; k < 17; ++k) {
    const auto& s = mission.samples[k];
    EXPECT_NEAR(s.battery_current_a, static_cast<double>(k) + 2.5, 1e-9);
    EXPECT_NEAR(s.battery_voltage_v, 24 + 0.1 * (static_cast<double>(k) + 2.5), 1e-9);
    EXPECT_EQ(s.motor_current_a[0], static_cast<double>(k));
  }
  for (std::size_t k = 17; k < 20; ++k) EXPECT_TRUE(std::isnan(mission.samples[k].battery_current_a));
}

TEST(MoveBatteryBack, ClearsRowsWithoutBatteryReadings) {
  telemetry::Recording mission = rows(20);
  move_back(mission, -0.2, true);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_TRUE(std::isnan(mission.samples[k].battery_voltage_v));
  for (std::size_t k = 2; k < 20; ++k)
    EXPECT_NEAR(mission.samples[k].battery_current_a, static_cast<double>(k) - 2, 1e-9);
}

TEST(MoveBatteryBack, AcceptsOneRowOrNone) {
  telemetry::Recording mission = rows(1), none = rows(0);
  move_back(mission, 0.1, true);
  EXPECT_TRUE(std::isnan(mission.samples[0].battery_current_a));
  move_back(none, 0.1, true);
}

}  // namespace
}  // namespace joulecast::gap
