#include "tests/dynamics/forward/forward.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/sample_robots.h"

namespace joulecast::dynamics {
namespace {

// The thesis's P3-DX, tables 2-1 and 2-2; no friction torque, gear included in the constants.
robot::RobotModel thesis_p3dx() {
  robot::RobotModel r;
  r.robot_id = "p3dx";
  r.kinematics = {.wheel_radius_m = 0.095, .half_track_m = 0.165, .com_offset_m = 0};
  r.mass = {.chassis_kg = 6.04, .wheel_kg = 1.48, .yaw_inertia_kg_m2 = 0.25, .wheel_inertia_kg_m2 = 0};
  r.motor = {.resistance_ohm = 0.7,
             .inductance_h = 0,
             .torque_constant_nm_a = 0.88,
             .voltage_constant_v_s_rad = 0.88,
             .gear_ratio = 1,
             .rotor_inertia_kg_m2 = 0.0713,
             .viscous_friction_nm_s_rad = 0.039,
             .friction_torque_nm = {0, 0}};
  r.battery.nominal_voltage_v = 12;
  r.battery.capacity_ah = 7;
  return r;
}

DriveState simulated(const DriveModel& model, double duration_s, double inductance_h,
                     std::array<double, 2> voltage_v) {
  DriveState state;
  const auto plus = [](const DriveState& a, const DriveState& d, double h) {
    DriveState s = a;
    s.x_m += h * d.x_m;
    s.y_m += h * d.y_m;
    s.heading_rad += h * d.heading_rad;
    for (std::size_t k : {0u, 1u}) {
      s.wheel_angle_rad[k] += h * d.wheel_angle_rad[k];
      s.wheel_speed_rad_s[k] += h * d.wheel_speed_rad_s[k];
      s.current_a[k] += h * d.current_a[k];
      s.copper_heat_w[k] += h * d.copper_heat_w[k];
    }
    return s;
  };
  constexpr double step = 1e-4;
  for (int k = 0; k < static_cast<int>(std::lround(duration_s / step)); ++k) {
    const DriveState half = plus(state, derivative(model, state, 0, inductance_h, voltage_v), step / 2);
    state = plus(state, derivative(model, half, 0, inductance_h, voltage_v), step);
  }
  return state;
}

// Thesis section 2.2.1, figure 2-2: 5 V on both motors for 10 s.
TEST(Forward, PioneerTravelsAsPrinted) {
  const DriveModel model(thesis_p3dx(), {});
  const DriveState end = simulated(model, 10, 0, {5, 5});
  EXPECT_NEAR(end.x_m, 5.14, 0.01 * 5.14);
  EXPECT_NEAR(end.y_m, 0, 1e-12);
}

// Figure 2-3: the left motor alone; the axle's middle circles the stopped right wheel at half the track.
TEST(Forward, PioneerTurnsOnOneMotor) {
  robot::RobotModel robot = thesis_p3dx();
  robot.motor.friction_torque_nm = {
      0.12, 0.11};  // holds the undriven wheel, which the printed figure shows at rest
  const DriveModel model(robot, {});
  const DriveState end = simulated(model, 10, 0, {0, 5});
  const double path = 0.095 * (end.wheel_angle_rad[0] + end.wheel_angle_rad[1]) / 2;
  const double radius = std::fabs(path / end.heading_rad);
  EXPECT_NEAR(radius, 0.165, 0.05 * 0.165);
}

TEST(Forward, InductanceDelaysTheCurrent) {
  robot::RobotModel robot = thesis_p3dx();
  const DriveModel model(robot, {});
  const double inductance = 0.007, tau = inductance / 0.7;
  DriveState state;
  const DriveState rate = derivative(model, state, 0, inductance, {5, 5});
  EXPECT_NEAR(rate.current_a[0], 5 / inductance, 1e-9);
  const DriveState soon = simulated(model, tau, inductance, {5, 5});
  // Back-EMF is still negligible after one time constant: 1 - 1/e of V/R.
  EXPECT_NEAR(soon.current_a[0], 5 / 0.7 * (1 - std::exp(-1.0)), 0.05 * 5 / 0.7);
}

TEST(Forward, SettlesAtSteadyState) {
  const DriveModel model(testing::nomad(), {});
  const DriveState end = simulated(model, 10, 0.0026, {12, 10});
  Instant at;
  at.wheel_speed_rad_s = end.wheel_speed_rad_s;
  const auto flow = model.flow(at);
  EXPECT_NEAR(flow.voltage_v[0], 12, 1e-3);
  EXPECT_NEAR(flow.voltage_v[1], 10, 1e-3);
}

}  // namespace
}  // namespace joulecast::dynamics
