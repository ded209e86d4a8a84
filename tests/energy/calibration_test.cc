// Calibration against runs with given parameters: prescribed motions through the inverse model, and
// forward simulation with sensor noise.
#include "energy/calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "robot/robot_file.h"
#include "tests/dynamics/forward/forward.h"

namespace joulecast::energy {
namespace {

using signals::Sample;

robot::RobotModel nomad() {
  auto robot = robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/nomad.json");
  EXPECT_TRUE(robot) << describe(robot.error());
  return *robot;
}

// The start of a calibration: geometry and masses right, the drive's parameters wrong.
robot::RobotModel misjudged(robot::RobotModel robot) {
  robot.motor.resistance_ohm *= 1.7;
  robot.motor.torque_constant_nm_a *= 0.8;
  robot.motor.voltage_constant_v_s_rad *= 0.8;
  robot.motor.friction_torque_nm = {0.1, 0.1};
  robot.motor.viscous_friction_nm_s_rad = 0.02;
  return robot;
}

// Samples at 50 Hz of the wheel speeds a + b t + c t^2 of each side, with power by the model: quadratic
// speeds have exact accelerations from the filter.
std::vector<Sample> prescribed(const robot::RobotModel& robot, std::array<double, 3> right,
                               std::array<double, 3> left, double payload_kg) {
  const auto model = *dynamics::drive_model(robot);
  std::vector<Sample> samples;
  for (int k = 0; k <= 300; ++k) {
    const double t = 0.02 * k;
    dynamics::Instant at;
    const std::array<const std::array<double, 3>*, 2> sides{&right, &left};
    for (std::size_t s : {0u, 1u}) {
      const auto& c = *sides[s];
      at.wheel_speed_rad_s[s] = c[0] + c[1] * t + c[2] * t * t;
      at.wheel_acceleration_rad_s2[s] = c[1] + 2 * c[2] * t;
    }
    at.payload_kg = payload_kg;
    const auto flow = model.flow(at);
    Sample sample;
    sample.utime_us = 20'000LL * k;
    sample.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    sample.motor_current_a = flow.current_a;
    sample.motor_voltage_v = flow.voltage_v;
    sample.payload_kg = payload_kg;
    samples.push_back(sample);
  }
  return samples;
}

// No noise: least squares returns the parameters to rounding, which the normal equations' condition (below
// 1e6 here) lets grow to below 1e-9.
constexpr double rounding = 1e-9;

TEST(CalibrateDrive, SteadySpeedsRecoverFriction) {
  const robot::RobotModel robot = nomad();
  std::vector<std::vector<Sample>> samples;
  for (double speed_m_s = 0.1; speed_m_s < 0.95; speed_m_s += 0.1) {
    const double w = speed_m_s / robot.kinematics.wheel_radius_m;
    samples.push_back(prescribed(robot, {w, 0, 0}, {w, 0, 0}, 0));
  }
  std::vector<telemetry::Recording> runs;
  for (const auto& s : samples) runs.push_back({"", "", 0, s});
  const auto fit = calibrate_drive(misjudged(robot), runs, {});
  ASSERT_TRUE(fit) << describe(fit.error());
  const robot::Motor &found = fit->robot.motor, &truth = robot.motor;
  EXPECT_NEAR(found.friction_torque_nm[0], 0.3728, 0.3728 * rounding);
  EXPECT_NEAR(found.friction_torque_nm[1], 0.346, 0.346 * rounding);
  EXPECT_NEAR(found.viscous_friction_nm_s_rad, truth.viscous_friction_nm_s_rad,
              rounding * truth.friction_torque_nm[0]);
  EXPECT_NEAR(found.resistance_ohm, truth.resistance_ohm, truth.resistance_ohm * rounding);
  EXPECT_NEAR(found.torque_constant_nm_a, truth.torque_constant_nm_a, truth.torque_constant_nm_a * rounding);
  // Constant speed does not show inertia.
  EXPECT_EQ(found.rotor_inertia_kg_m2, misjudged(robot).motor.rotor_inertia_kg_m2);
}

TEST(CalibrateDrive, WholeRunsRecoverEveryParameter) {
  robot::RobotModel robot = nomad();
  robot.motor.inductance_h = 0;  // of which the prescribed voltages contain nothing
  const std::vector<std::vector<Sample>> samples{prescribed(robot, {1, 1.5, -0.1}, {1.2, 1.1, -0.05}, 0),
                                                 prescribed(robot, {9, -2, 0.12}, {4, 0.5, 0.05}, 5),
                                                 prescribed(robot, {-1, -1, 0}, {-2, -0.7, -0.02}, 0),
                                                 prescribed(robot, {-5, -0.3, 0.02}, {6, 0.2, -0.1}, 0)};
  std::vector<telemetry::Recording> runs;
  for (const auto& s : samples) runs.push_back({"", "", 0, s});
  robot::RobotModel start = misjudged(robot);
  start.motor.rotor_inertia_kg_m2 = 0.05;
  start.mass.yaw_inertia_kg_m2 = 0.5;
  const auto fit = calibrate_drive(start, runs, {.method = CalibrationMethod::whole});
  ASSERT_TRUE(fit) << describe(fit.error());
  const robot::Motor &found = fit->robot.motor, &truth = robot.motor;
  // Sums of products over windows: friction and its growth with speed are nearly alike at these speeds.
  constexpr double of_windows = 100 * rounding;
  for (std::size_t s : {0u, 1u})
    EXPECT_NEAR(found.friction_torque_nm[s], truth.friction_torque_nm[s],
                truth.friction_torque_nm[s] * of_windows);
  EXPECT_NEAR(found.viscous_friction_nm_s_rad, truth.viscous_friction_nm_s_rad,
              of_windows * truth.friction_torque_nm[0]);
  EXPECT_NEAR(found.resistance_ohm, truth.resistance_ohm, truth.resistance_ohm * rounding);
  EXPECT_NEAR(found.voltage_constant_v_s_rad, truth.voltage_constant_v_s_rad, rounding);
  EXPECT_NEAR(found.rotor_inertia_kg_m2, truth.rotor_inertia_kg_m2, rounding);
  EXPECT_NEAR(fit->robot.mass.yaw_inertia_kg_m2, robot.mass.yaw_inertia_kg_m2,
              robot.mass.yaw_inertia_kg_m2 * 10 * rounding);
}

// The equations of the effects are written out here: nothing of the drive model's is used.
TEST(CalibrateDrive, CountsEffectsOfFileOnce) {
  robot::RobotModel truth = nomad();
  truth.motor.inductance_h = 0;
  truth.motor.rotor_inertia_kg_m2 = 0.02;
  truth.effects = {{"gear_efficiency", {{"loss", 0.12}, {"of_friction", 0.7}}},
                   {"coulomb_friction", {{"ratio", 0.4}, {"extra_nm", 0.05}}},
                   {"viscous_friction", {{"ratio", 1.5}, {"extra_nm_s_rad", 0}}},
                   {"resistance_error", {{"ratio", 0.25}}},
                   {"brush_drop", {{"voltage_v", 0.6}}},
                   {"torque_constant_loss", {{"loss", 0.1}, {"voltage_share", 1}}}};
  const robot::Motor& m = truth.motor;
  const double radius_m = truth.kinematics.wheel_radius_m;
  const double inertia_kg_m2 = (truth.mass.chassis_kg + 2 * truth.mass.wheel_kg) * radius_m * radius_m / 2 +
                               truth.mass.wheel_inertia_kg_m2 + m.rotor_inertia_kg_m2;
  std::vector<std::vector<Sample>> samples;
  for (const auto& [start, slope] :
       {std::pair{1.0, 0.0}, {4, 0}, {8, 0}, {1, 1.2}, {9, -1.2}, {-2, -0.8}, {-5, 0}}) {
    std::vector<Sample>& run = samples.emplace_back();
    for (int k = 0; k <= 300; ++k) {
      Sample& sample = run.emplace_back();
      sample.utime_us = 20'000LL * k;
      sample.payload_kg = 0;
      const double speed = start + slope * 0.02 * k, direction = speed > 0 ? 1 : -1;
      for (std::size_t s : {0u, 1u}) {
        const double friction =
            (1.4 * m.friction_torque_nm[s] + 0.05) * direction + 2.5 * m.viscous_friction_nm_s_rad * speed;
        const double load = inertia_kg_m2 * slope;
        const double torque = load + friction + 0.12 * std::fabs(load + 0.7 * friction) * direction;
        const double current = torque / (0.9 * m.torque_constant_nm_a * m.gear_ratio);
        sample.wheel_velocity_rad_s[s] = speed;
        sample.motor_current_a[s] = current;
        sample.motor_voltage_v[s] = 1.25 * m.resistance_ohm * current + std::copysign(0.6, current) +
                                    0.9 * m.voltage_constant_v_s_rad * m.gear_ratio * speed;
      }
    }
  }
  std::vector<telemetry::Recording> runs;
  for (const auto& s : samples) runs.push_back({"", "", 0, s});
  for (const CalibrationMethod method : {CalibrationMethod::steady, CalibrationMethod::whole}) {
    robot::RobotModel start = truth;
    start.motor.resistance_ohm *= 1.3;
    start.motor.friction_torque_nm = {0.3, 0.3};
    start.motor.viscous_friction_nm_s_rad = 0.003;
    if (method == CalibrationMethod::whole) start.motor.rotor_inertia_kg_m2 = 0.04;
    const auto fit = calibrate_drive(start, runs, {.method = method});
    ASSERT_TRUE(fit) << describe(fit.error());
    const robot::Motor& found = fit->robot.motor;
    EXPECT_EQ(fit->robot.effects, truth.effects);
    // The model's brush drop rises smoothly from zero current, by 5e-4 less at 0.3 A.
    const auto expect_near = [](double value, double true_value) {
      EXPECT_NEAR(value, true_value, 5e-4 * true_value);
    };
    for (std::size_t s : {0u, 1u}) expect_near(found.friction_torque_nm[s], m.friction_torque_nm[s]);
    expect_near(found.viscous_friction_nm_s_rad, m.viscous_friction_nm_s_rad);
    expect_near(found.resistance_ohm, m.resistance_ohm);
    expect_near(found.torque_constant_nm_a, m.torque_constant_nm_a);
    expect_near(found.rotor_inertia_kg_m2, m.rotor_inertia_kg_m2);
  }
}

// Voltage staircases driven through (2-43) by Runge-Kutta steps of 1 ms, sampled at 50 Hz.
std::vector<Sample> simulated(const robot::RobotModel& robot, double direction, std::mt19937& random) {
  const auto model = *dynamics::drive_model(robot);
  std::normal_distribution<double> unit;
  dynamics::DriveState state;
  std::vector<Sample> samples;
  constexpr double step_s = 1e-3;
  for (int k = 0; k < 45'000; ++k) {
    const double volts = direction * (2 + 1.5 * (k / 5'000));
    const std::array<double, 2> voltage{volts, volts};
    if (k % 20 == 0) {
      const auto current = dynamics::algebraic_current(model, state, voltage);
      Sample sample;
      sample.utime_us = 1'000LL * k;
      for (std::size_t s : {0u, 1u}) {
        sample.wheel_velocity_rad_s[s] = state.wheel_speed_rad_s[s] + 0.005 * unit(random);
        sample.motor_current_a[s] = current[s] + 0.02 * unit(random);
        sample.motor_voltage_v[s] = volts + 0.05 * unit(random);
      }
      samples.push_back(sample);
    }
    const auto moved = [&](const dynamics::DriveState& by, double h) {
      dynamics::DriveState next = state;
      next.heading_rad += h * by.heading_rad;
      for (std::size_t s : {0u, 1u}) next.wheel_speed_rad_s[s] += h * by.wheel_speed_rad_s[s];
      return next;
    };
    const auto k1 = dynamics::derivative(model, state, 0, 0, voltage);
    const auto k2 = dynamics::derivative(model, moved(k1, step_s / 2), 0, 0, voltage);
    state = moved(k2, step_s);
  }
  return samples;
}

TEST(CalibrateDrive, ErrorsCoverTheTrueFriction) {
  const robot::RobotModel robot = nomad();
  std::mt19937 random(20240718);
  const auto forward = simulated(robot, 1, random), backward = simulated(robot, -1, random);
  const std::vector<telemetry::Recording> runs{{"", "forward", 0, forward}, {"", "backward", 0, backward}};
  for (const CalibrationMethod method : {CalibrationMethod::steady, CalibrationMethod::whole}) {
    SCOPED_TRACE(method == CalibrationMethod::steady ? "steady" : "whole");
    // R and K are measured separately from the friction, as in the thesis.
    robot::RobotModel start = robot;
    start.motor.friction_torque_nm = {0.1, 0.1};
    start.motor.viscous_friction_nm_s_rad = 0.02;
    const auto fit =
        calibrate_drive(start, runs, {.method = method, .resistance_known = true, .constants_known = true});
    ASSERT_TRUE(fit) << describe(fit.error());
    const std::array<double, 2> truth{0.3728, 0.346};
    for (std::size_t s : {0u, 1u}) {
      const ParameterEstimate& estimate = fit->estimates[3 + s];
      ASSERT_TRUE(estimate.fitted);
      // Four standard errors: one run in 16,000 would exceed them; and they must be small.
      EXPECT_NEAR(estimate.value, truth[s], 4 * estimate.standard_error) << estimate.name;
      EXPECT_LT(estimate.standard_error, 0.02 * truth[s]);
      EXPECT_EQ(fit->robot.motor.friction_torque_nm[s], estimate.value);
    }
  }
}

TEST(CalibrateDrive, NamesTheMissingData) {
  const robot::RobotModel robot = nomad();
  std::vector<Sample> samples = prescribed(robot, {5, 0, 0}, {5, 0, 0}, 0);
  for (Sample& s : samples) s.motor_current_a = {signals::unmeasured, signals::unmeasured};
  const std::vector<telemetry::Recording> runs{{"", "", 0, samples}};
  const auto fit = calibrate_drive(robot, runs, {});
  ASSERT_FALSE(fit);
  EXPECT_EQ(fit.error().field, "motor_current");
  // One speed alone cannot distinguish T_m from nu: nu stays as it was.
  const auto steady = prescribed(robot, {5, 0, 0}, {5, 0, 0}, 0);
  const std::vector<telemetry::Recording> one_speed{{"", "", 0, steady}};
  const auto held = calibrate_drive(robot, one_speed, {.resistance_known = true, .constants_known = true});
  ASSERT_TRUE(held) << describe(held.error());
  EXPECT_EQ(held->robot.motor.viscous_friction_nm_s_rad, robot.motor.viscous_friction_nm_s_rad);
}

}  // namespace
}  // namespace joulecast::energy
