#include "plausibility/cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/plausibility/made_recordings.h"

namespace joulecast::plausibility {
namespace {

TEST(Cells, ReturnsChannelMeansAndSlopes) {
  const auto recording = made::mission(10, 50, [](double t, signals::Sample& s) {
    s.wheel_velocity_rad_s = {2 + 0.5 * t, -3.0};
    s.battery_voltage_v = 24;
    s.battery_current_a = 2 + t;
    // A gyro at a third of the sampling rate.
    if (s.sequence % 3 == 0) s.yaw_rate_rad_s = 0.2;
  });
  CellCutter cutter(10, 5.0);
  std::size_t count = 0;
  for (const auto& s : recording.samples) {
    const auto cell = cutter.add(s);
    if (!cell) continue;
    ++count;
    EXPECT_NEAR(cell->acceleration_rad_s2[0], 0.5, 1e-9);
    EXPECT_EQ(cell->way[0], 1);
    EXPECT_EQ(cell->way[1], -1);
    EXPECT_NEAR(cell->battery_power_w, 24 * cell->mean[reading::battery_current], 1e-9);
    EXPECT_NEAR(cell->mean[reading::battery_current], 2 + (cell->mean[0] - 2) / 0.5, 1e-9);
    EXPECT_NEAR(cell->mean[reading::yaw_rate], 0.2, 1e-12);
    EXPECT_TRUE(std::isnan(cell->mean[reading::pitch]));
    EXPECT_EQ(cell->mean[reading::payload], 5);
  }
  EXPECT_GE(count, 23u);
}

// Cells of 20 rows.
TEST(Cells, SeparateNoiseFromMotion) {
  for (const double noise : {0.0, 0.1}) {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    const auto recording = made::mission(400, 50, [&](double t, signals::Sample& s) {
      s.wheel_velocity_rad_s[0] = 3 + 2 * std::sin(2 * t) + noise * normal(random);
    });
    CellCutter cutter(10, 0);
    double mean = 0, slope = 0, count = 0;
    for (const auto& s : recording.samples) {
      const auto cell = cutter.add(s);
      if (!cell) continue;
      mean += cell->noise[0] * cell->noise[0];
      slope += cell->acceleration_noise[0] * cell->acceleration_noise[0];
      ++count;
    }
    const double rows = 20, step_s = 0.02;
    EXPECT_NEAR(std::sqrt(mean / count), noise / std::sqrt(rows), 0.002);
    EXPECT_NEAR(std::sqrt(slope / count), noise / step_s * std::sqrt(12 / (rows * (rows * rows - 1))), 0.02);
  }
}

TEST(Cells, RejectsCellsAcrossGaps) {
  CellCutter cutter(10, 0);
  std::size_t count = 0;
  for (int k = 0; k < 100; ++k) {
    signals::Sample s;
    s.utime_us = 20'000 * k + 5'000'000 * (k / 10);  // ten rows at a time
    s.wheel_velocity_rad_s = {k < 50 ? 1.0 : -1.0, 1.0};
    count += cutter.add(s).has_value();
  }
  EXPECT_EQ(count, 0u);  // ten rows at 50 Hz are half a cell
}

// An arc to the left on a map with the heading in radians or in degrees.
TEST(Spans, MatchesCircularArc) {
  const double radius = 4, speed = 0.8, rate = speed / radius;
  for (const bool degrees : {false, true}) {
    const auto recording = made::mission(60, 20, [&](double t, signals::Sample& s) {
      const double heading = rate * t;
      s.wheel_velocity_rad_s = {10, 8};
      s.yaw_rate_rad_s = rate;
      s.pose = {radius * std::sin(heading), radius * (1 - std::cos(heading)),
                degrees ? std::remainder(heading * 180 / std::numbers::pi, 360.0)
                        : std::remainder(heading, 2 * std::numbers::pi)};
    });
    SpanCutter cutter;
    std::size_t count = 0;
    for (const auto& s : recording.samples) {
      const auto span = cutter.add(s);
      if (!span) continue;
      ++count;
      EXPECT_NEAR(span->gyro_rad, rate * span->length_s, 1e-6);
      EXPECT_NEAR(span->turned_rad[0], 10 * span->length_s, 1e-6);
      if (degrees) {
        EXPECT_NEAR(span->heading_deg, rate * span->length_s * 180 / std::numbers::pi, 1e-6);
        continue;
      }
      EXPECT_NEAR(span->heading_rad, rate * span->length_s, 1e-6);
      const double half = 0.5 * rate * span->length_s;
      EXPECT_NEAR(span->forward, speed * span->length_s * std::sin(half) / half, 1e-3);
    }
    EXPECT_GE(count, 28u);
  }
}

}  // namespace
}  // namespace joulecast::plausibility
