#include "dynamics/straight.h"

namespace joulecast::dynamics {

QuadraticPower wheel_power(double rho, double kappa, double inertia, double damping, double friction) {
  return {rho * inertia * inertia,
          2 * rho * inertia * damping + kappa * inertia,
          2 * rho * inertia * friction,
          rho * damping * damping + kappa * damping,
          2 * rho * damping * friction + kappa * friction,
          rho * friction * friction};
}

StraightPower straight_power(const robot::RobotModel& robot, double payload_kg) {
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
