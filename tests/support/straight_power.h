#pragma once

#include <array>

#include "dynamics/straight.h"
#include "robot/robot_model.h"

// The thesis's power on a straight line, with which tests compare the drive model and the planner.
namespace joulecast::dynamics {

// The same power over the coordinate y = scale * x.
inline QuadraticPower rescaled(const QuadraticPower& p, double scale) {
  const double s = 1 / scale;
  return {p.c1 * s * s, p.cx * s * s, p.ca * s, p.c2 * s * s, p.c3 * s, p.c0};
}

// Electrical power of the motors on a straight line, over the wheel angle [rad], idle power left out.
// Thesis (3-2), (3-3) for each side and (4-1) for `both`, with J = I_w + I_s + m r^2/2; the term in a^2 m_p^2
// that the thesis drops is included. Without the effects of the robot file.
struct StraightPower {
  std::array<QuadraticPower, 2> side;
  QuadraticPower both;
  double wheel_radius_m = 0;

  QuadraticPower over_distance() const { return rescaled(both, wheel_radius_m); }
};

inline StraightPower straight_power(const robot::RobotModel& robot, double payload_kg) {
  const robot::Motor& motor = robot.motor;
  const double radius = robot.kinematics.wheel_radius_m;
  const double torque_constant = motor.torque_constant_nm_a * motor.gear_ratio;
  const double rho = motor.resistance_ohm / (torque_constant * torque_constant);
  const double kappa = motor.voltage_constant_v_s_rad / motor.torque_constant_nm_a;
  const double inertia = robot.mass.wheel_inertia_kg_m2 + motor.rotor_inertia_kg_m2 +
                         robot.total_mass_kg(payload_kg) * radius * radius / 2;
  StraightPower power;
  power.wheel_radius_m = radius;
  for (std::size_t s : {robot::right, robot::left}) {
    power.side[s] =
        wheel_power(rho, kappa, inertia, motor.viscous_friction_nm_s_rad, motor.friction_torque_nm[s]);
    power.both += power.side[s];
  }
  return power;
}

}  // namespace joulecast::dynamics
