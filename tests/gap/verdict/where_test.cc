#include "gap/verdict/where.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "client/virtual_robot/fleet.h"
#include "robot/robot_file.h"

namespace joulecast::gap {
namespace {

robot::RobotModel nomad() {
  return *robot::parse_robot(virtual_robot::shipped_robots()[1].json_text);
}

constexpr double step_s = 0.2, length_s = 600, slow_m_s = 0.4, fast_m_s = 0.8, modelled_w = 100;

// A straight drive, alternately 30 s slow and 30 s fast. Motors are not measured.
std::vector<Window> drive() {
  const double radius_m = nomad().kinematics.wheel_radius_m;
  std::vector<Window> windows;
  for (int k = 0; k * step_s < length_s; ++k) {
    Window w;
    w.t_s = k * step_s;
    w.speed_rad_s.fill((std::fmod(w.t_s, 60) < 30 ? slow_m_s : fast_m_s) / radius_m);
    w.moving = {true, true};
    windows.push_back(w);
  }
  return windows;
}

bool fast(const Window& w) {
  return std::fmod(w.t_s, 60) >= 30;
}

// The residual is `missed_w` where `holds` is true, plus noise of 1 W.
template <class Holds>
std::vector<WhereRegion> where_of(double missed_w, double noise_floor, const Holds& holds) {
  const std::vector<Window> windows = drive();
  const std::vector<double> modelled(windows.size(), modelled_w);
  std::mt19937_64 random(51);
  std::normal_distribution<double> noise(0, 1);
  std::vector<double> measured;
  for (const Window& w : windows) measured.push_back(modelled_w + (holds(w) ? missed_w : 0) + noise(random));
  return localise(windows, nomad(), measured, modelled, noise_floor, "battery_power");
}

TEST(Localise, FindsTimeInterval) {
  const auto found = where_of(20, 0.008, [](const Window& w) { return w.t_s >= 200 && w.t_s < 300; });
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].variable, "time_s");
  EXPECT_EQ(found[0].channel, "battery_power");
  EXPECT_NEAR(found[0].from, 200, 1);
  EXPECT_NEAR(found[0].to, 300, 1);
  EXPECT_NEAR(found[0].time_share, 1.0 / 6, 0.01);
  // 2000 J of the sum of 2000 J and the noise elsewhere, sqrt(2/pi) W.
  const double share = 2000 / (2000 + 500 * std::sqrt(2 / std::numbers::pi));
  EXPECT_NEAR(found[0].share, share, 0.02);
  EXPECT_LE(found[0].interval[0], share);
  EXPECT_GE(found[0].interval[1], share);
  // No other time interval exceeds its share.
  EXPECT_EQ(std::ranges::count(found, "time_s", &WhereRegion::variable), 1);
}

TEST(Localise, FindsSpeedRangeOnly) {
  const auto found = where_of(-15, 0.008, fast);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].variable, "speed_m_s");
  EXPECT_NEAR(found[0].to, fast_m_s, 1e-9);
  EXPECT_GT(found[0].from, slow_m_s);
  EXPECT_LT(found[0].share, -0.9);
  EXPECT_NEAR(found[0].time_share, 0.5, 0.01);
  EXPECT_EQ(std::ranges::count(found, "time_s", &WhereRegion::variable), 0);
}

TEST(Localise, ReturnsNothingForNoise) {
  EXPECT_TRUE(where_of(0, 0, fast).empty());
  // Errors below the noise floor have no region.
  EXPECT_FALSE(where_of(15, 0.04, fast).empty());
  EXPECT_TRUE(where_of(15, 0.08, fast).empty());
}

}  // namespace
}  // namespace joulecast::gap
