#include "dynamics/climb.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "dynamics/drive_model.h"
#include "tests/support/sample_robots.h"

namespace joulecast::dynamics {
namespace {

using Height = std::function<double(double)>;  // over the place along the way, both m

// A drive at a speed over time, along a floor of that height.
std::vector<ClimbReading> drive(double duration_s, double rate_hz,
                                const std::function<double(double)>& speed_m_s, const Height& height,
                                const std::function<double(double)>& sensor) {
  std::vector<ClimbReading> readings;
  double place = 0, last_speed = speed_m_s(0);
  const int count = static_cast<int>(duration_s * rate_hz);
  for (int k = 0; k < count; ++k) {
    const double t = k / rate_hz, speed = speed_m_s(t);
    if (k > 0) place += 0.5 * (speed + last_speed) / rate_hz;
    last_speed = speed;
    readings.push_back(
        {1'700'000'000'000'000 + std::llround(1e6 * t), speed, unknown, sensor(height(place))});
  }
  return readings;
}

double exact(double height) {
  return height;
}

std::vector<double> tracked(const std::vector<ClimbReading>& readings) {
  ClimbTracker tracker;
  std::vector<double> climb;
  for (const ClimbReading& r : readings) climb.push_back(tracker.add(r));
  return climb;
}

double worst(const std::vector<double>& climb, double expected, std::size_t from) {
  double most = 0;
  for (std::size_t k = from; k < climb.size(); ++k) most = std::max(most, std::fabs(climb[k] - expected));
  return most;
}

TEST(Climb, MatchesEvenRampBothWays) {
  for (const double speed : {0.6, -0.6}) {
    const auto readings = drive(
        20, 50, [&](double) { return speed; }, [](double s) { return 0.05 * s; }, exact);
    // Nose up where the height rises with the way ahead, whichever way the robot drives.
    EXPECT_LT(worst(climb_along(readings), std::asin(0.05), 0), 1e-9) << speed;
    EXPECT_LT(worst(tracked(readings), std::asin(0.05), 60), 1e-9) << speed;
  }
}

TEST(Climb, OnlineNeedsHalfAWindow) {
  const auto speed = [](double t) { return t < 2 ? 0.0 : t < 12 ? 0.5 : 0.0; };
  const auto readings = drive(
      20, 50, speed, [](double s) { return 0.08 * s; }, exact);
  const auto climb = tracked(readings);
  for (std::size_t k = 0; k < 100; ++k) EXPECT_TRUE(std::isnan(climb[k]));
  EXPECT_FALSE(std::isnan(climb[100 + 30]));  // 0.3 m on
  for (std::size_t k = 601; k < climb.size(); ++k) EXPECT_NEAR(climb[k], std::asin(0.08), 1e-6);
  // Offline, the samples after the standstill determine the floor there.
  for (const double value : climb_along(readings)) EXPECT_NEAR(value, std::asin(0.08), 1e-6);
}

TEST(Climb, FollowsFloorWithinAWindow) {
  // Flat, a ramp of 10 % over 4 m, flat again, at 0.5 m/s.
  const Height ramp = [](double s) { return 0.1 * std::clamp(s - 5, 0.0, 4.0); };
  const auto readings = drive(
      30, 50, [](double) { return 0.5; }, ramp, exact);
  const auto offline = climb_along(readings), online = tracked(readings);
  for (std::size_t k = 50; k < readings.size(); ++k) {
    const double place = 0.01 * static_cast<double>(k);
    const double truth = place > 5 && place < 9 ? std::asin(0.1) : 0;
    if (std::min(std::fabs(place - 5), std::fabs(place - 9)) > 0.3) {
      EXPECT_NEAR(offline[k], truth, 2e-3) << place;
    }
    const bool settled = (place > 5.6 && place < 9) || place < 5 || place > 9.6;
    if (settled) {
      EXPECT_NEAR(online[k], truth, 2e-3) << place;
    }
  }
}

// Heights in whole metres at 5 Hz, as maps and satellites give them: no spikes where they change.
TEST(Climb, RoundedHeightHasNoSpikes) {
  const Height hills = [](double s) { return 8 * std::sin(s / 250); };
  const auto rounded = [](double h) { return std::round(h); };
  const auto readings = drive(
      600, 5, [](double t) { return 12 + 4 * std::sin(t / 30); }, hills, rounded);
  const auto truth = climb_along(drive(
      600, 5, [](double t) { return 12 + 4 * std::sin(t / 30); }, hills, exact));
  const auto offline = climb_along(readings), online = tracked(readings);
  double offline_error = 0, online_error = 0, size = 0;
  std::size_t counted = 0;
  for (std::size_t k = 300; k + 50 < readings.size(); ++k, ++counted) {
    EXPECT_LT(std::fabs(offline[k]), 0.045);  // the steepest of the floor is 0.032
    EXPECT_LT(std::fabs(online[k]), 0.06);
    offline_error += std::pow(offline[k] - truth[k], 2);
    online_error += std::pow(online[k] - truth[k], 2);
    size += truth[k] * truth[k];
  }
  EXPECT_LT(std::sqrt(offline_error / size), 0.25);
  EXPECT_LT(std::sqrt(online_error / size), 0.5);
}

TEST(Climb, HeldHeightFollowsTheFloor) {
  // Fresh once a second, held between.
  const auto readings = [&] {
    auto r = drive(
        60, 50, [](double) { return 0.8; }, [](double s) { return -0.04 * s; }, exact);
    for (std::size_t k = 0; k < r.size(); ++k) r[k].height_m = r[k - k % 50].height_m;
    return r;
  }();
  EXPECT_LT(worst(climb_along(readings), std::asin(-0.04), 0), 0.012);
  EXPECT_LT(worst(tracked(readings), std::asin(-0.04), 400), 0.012);
}

TEST(Climb, NoiseLengthensTheWindow) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.03);
  const auto readings = drive(
      120, 10, [](double) { return 0.5; }, [](double s) { return 0.03 * s; },
      [&](double h) { return h + noise(random); });
  const auto offline = climb_along(readings), online = tracked(readings);
  EXPECT_LT(worst(offline, std::asin(0.03), 0), 0.05);  // a window of half a metre would be off by 0.2
  EXPECT_LT(worst(online, std::asin(0.03), 400), 0.05);
}

TEST(Climb, HeightAtStandstillIsDrift) {
  // Half a minute of level driving, a minute of standing in which the height creeps up by 2 m, and level
  // driving.
  auto readings = drive(
      120, 10, [](double t) { return t < 30 || t > 90 ? 0.5 : 0.0; }, [](double) { return 3.0; }, exact);
  for (std::size_t k = 300; k < readings.size(); ++k)
    readings[k].height_m += std::min(2.0, 0.004 * static_cast<double>(k - 300));
  for (const double value : climb_along(readings)) EXPECT_NEAR(value, 0, 0.01);
  EXPECT_LT(worst(tracked(readings), 0, 50), 0.01);
}

TEST(Climb, PitchComesFirst) {
  auto readings = drive(
      20, 50, [](double) { return 0.5; }, [](double s) { return 0.05 * s; }, exact);
  for (std::size_t k = 0; k < readings.size(); k += 2) readings[k].pitch_rad = 0.2;
  const auto offline = climb_along(readings), online = tracked(readings);
  for (std::size_t k = 100; k + 1 < readings.size(); k += 2) {
    EXPECT_EQ(offline[k], 0.2);
    EXPECT_EQ(online[k], 0.2);
    EXPECT_NEAR(offline[k + 1], std::asin(0.05), 1e-9);
    EXPECT_NEAR(online[k + 1], std::asin(0.05), 1e-9);
  }
}

TEST(Climb, IsUnknownWithoutMeasurement) {
  auto readings = drive(
      20, 50, [](double) { return 0.5; }, [](double s) { return 0.05 * s; }, exact);
  for (std::size_t k = 400; k < 600; ++k) readings[k].height_m = unknown;
  // A silence of 5 s: the way in between is unknown.
  for (std::size_t k = 800; k < readings.size(); ++k) readings[k].utime_us += 5'000'000;
  readings[800].bridged = false;
  const auto offline = climb_along(readings), online = tracked(readings);
  EXPECT_NEAR(online[399], std::asin(0.05), 1e-9);
  for (std::size_t k = 401; k < 600; ++k) {
    EXPECT_TRUE(std::isnan(online[k]));
    EXPECT_TRUE(std::isnan(offline[k]));
  }
  EXPECT_TRUE(std::isnan(online[800]));
  EXPECT_NEAR(online.back(), std::asin(0.05), 1e-9);
  EXPECT_NEAR(offline[800], std::asin(0.05), 1e-9);
  for (ClimbReading& r : readings) r.height_m = unknown;
  for (const double value : climb_along(readings)) EXPECT_TRUE(std::isnan(value));
}

TEST(Climb, KeepsItsValueOnReversal) {
  const auto readings = drive(
      40, 50, [](double t) { return 0.5 * std::sin(2 * std::numbers::pi * t / 10); },
      [](double s) { return 0.06 * s; }, exact);
  EXPECT_LT(worst(climb_along(readings), std::asin(0.06), 0), 1e-6);
  EXPECT_LT(worst(tracked(readings), std::asin(0.06), 120), 1e-6);
}

TEST(Climb, IgnoresHeightJumps) {
  EXPECT_TRUE(std::isnan(climb_over(1, 1)));
  EXPECT_TRUE(std::isnan(climb_over(1, 0)));
  EXPECT_NEAR(climb_over(0.5, -1), -std::numbers::pi / 6, 1e-12);
  auto readings = drive(
      20, 50, [](double) { return 0.5; }, [](double s) { return 0.02 * s; }, exact);
  for (std::size_t k = 500; k < readings.size(); ++k) readings[k].height_m += 30;
  EXPECT_LT(worst(climb_along(readings), std::asin(0.02), 0), 1e-3);  // the rise while it jumped is lost
  EXPECT_LT(worst(tracked(readings), std::asin(0.02), 60), 1e-3);
}

TEST(Grade, MatchesWeightAlongTheFloor) {
  const robot::RobotModel robot = testing::nomad();
  ActiveEffect whole = initial(*find_effect("grade"));
  whole.values = {1, 0.01};
  const DriveModel with(robot, {&whole, 1}), without(robot, {});
  Instant at;
  at.wheel_speed_rad_s = {5, 5};
  at.payload_kg = 4;
  EXPECT_EQ(with.flow(at).battery_power_w, without.flow(at).battery_power_w);  // the climb is unknown
  at.climb_rad = 0.04;
  const double speed = 5 * robot.kinematics.wheel_radius_m;
  EXPECT_NEAR(with.flow(at).ledger[signals::Term::potential],
              robot.total_mass_kg(4) * robot::standard_gravity_m_s2 * std::sin(0.05) * speed, 1e-9);
}

}  // namespace
}  // namespace joulecast::dynamics
