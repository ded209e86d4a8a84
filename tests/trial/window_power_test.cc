#include "tests/study/trial/window_power.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/sample_robots.h"

namespace joulecast::trial {
namespace {

windows::Window driving(double speed_rad_s) {
  windows::Window w;
  w.speed_rad_s = {speed_rad_s, speed_rad_s};
  w.moving = {true, true};
  return w;
}

// At constant speed the motors supply dry and viscous friction and copper losses only.
double steady_power_w(const robot::RobotModel& robot, double speed_rad_s) {
  const robot::Motor& m = robot.motor;
  double power_w = robot.idle_power_w;
  for (const double friction_nm : m.friction_torque_nm) {
    const double torque_nm = friction_nm + m.viscous_friction_nm_s_rad * speed_rad_s;
    const double current_a = torque_nm / (m.torque_constant_nm_a * m.gear_ratio);
    power_w +=
        current_a * (m.resistance_ohm * current_a + m.voltage_constant_v_s_rad * m.gear_ratio * speed_rad_s);
  }
  return power_w;
}

TEST(WindowPower, IncludesFrictionAndCopper) {
  const robot::RobotModel robot = testing::nomad();
  const std::vector windows{driving(5)};
  EXPECT_NEAR(window_powers_w(robot, {}, windows)[0], steady_power_w(robot, 5),
              1e-6 * steady_power_w(robot, 5));
}

TEST(WindowPower, IsIdlePowerAtRest) {
  const robot::RobotModel robot = testing::nomad();
  windows::Window w;
  w.resting = {true, true};
  EXPECT_DOUBLE_EQ(window_powers_w(robot, {}, std::vector{w})[0], robot.idle_power_w);
}

TEST(WindowPower, SplitsWindowIntoParts) {
  const robot::RobotModel robot = testing::nomad();
  windows::Window w = driving(5);
  w.part_weight = {0.25, 0.5, 0.25};
  w.part_speed_rad_s = {{{2, 2}, {5, 5}, {8, 8}}};
  const double expected_w =
      0.25 * steady_power_w(robot, 2) + 0.5 * steady_power_w(robot, 5) + 0.25 * steady_power_w(robot, 8);
  EXPECT_NEAR(window_powers_w(robot, {}, std::vector{w})[0], expected_w, 1e-6 * expected_w);
}

}  // namespace
}  // namespace joulecast::trial
