#pragma once

#include <array>

#include "robot/robot_model.h"

namespace joulecast::dynamics {

// Wheel speed below which dry friction fades [rad/s], and current below which the voltage of the brush drop
// does [A]. Their power does not fade: it is continuous.
inline constexpr double friction_width_rad_s = 0.005;
inline constexpr double brush_width_a = 0.01;

// Resistance of copper grows by this fraction a kelvin.
inline constexpr double copper_temperature_coefficient_per_k = 0.00393;

// How a sensor departs from the truth: reading = (1 + gain) * truth + bias.
template <class S>
struct SensorError {
  S gain = 0;
  S bias = 0;
};

// The constants of the drive model, as changed by the effects in force. Sides: [0]
// right, [1] left. Defaults of zero are effects that the nominal model leaves out.
template <class S>
struct Parameters {
  std::array<S, 2> wheel_radius_m{};
  S half_track_m = 0;
  S com_offset_m = 0;
  S slip = 0;  // ground travels (1 - slip) of the wheel's circumference

  S chassis_kg = 0;
  S wheel_kg = 0;
  S payload_factor = 1;          // true over declared payload
  S payload_extra_kg = 0;        // undeclared payload
  S inertial_factor = 1;         // translational inertia over mass
  S yaw_inertia_kg_m2 = 0;       // without payload
  S payload_yaw_inertia_m2 = 0;  // that each kilogram of payload adds
  S wheel_inertia_kg_m2 = 0;     // wheel and rotor, at the wheel

  std::array<S, 2> friction_torque_nm{};
  S viscous_friction_nm_s_rad = 0;
  S gear_loss = 0;  // fraction of the torque that the gear transmits
  S gear_friction_share =
      0;  // of T_m and viscous friction: 1 on the wheel's side of the gear, 0 on the motor's

  S torque_constant_nm_a = 0;      // gear included: K_t n
  S voltage_constant_v_s_rad = 0;  // gear included: K_w n
  std::array<S, 2> resistance_ohm{};
  S inductance_h = 0;
  S brush_drop_v = 0;
  S thermal_resistance_k_w =
      0;  // winding over ambient; the time constant is the meter's and the diagnosis's state
  double thermal_time_constant_s = 600;

  S idle_power_w = 0;
  S accessory_power_w = 0;
  S driver_loss = 0;  // fraction of the motors' absolute power
  S unreturned = 0;   // fraction of braking power that does not reach the battery
  S battery_resistance_ohm = 0;
  double battery_voltage_v = 0;  // nominal

  SensorError<S> motor_current;
  SensorError<S> motor_voltage;
  SensorError<S> battery_current;
  SensorError<S> battery_voltage;
  S sensor_delay_s = 0;  // electrical channels lag motion by this
};

// The nominal parameters of a robot: its file, with no effect applied. Armature inductance is left out of the
// motion -> power direction, as the thesis does (2-33); forward simulation reads it from the robot file.
template <class S>
Parameters<S> nominal_parameters(const robot::RobotModel& robot) {
  Parameters<S> p;
  p.wheel_radius_m = {S(robot.kinematics.wheel_radius_m), S(robot.kinematics.wheel_radius_m)};
  p.half_track_m = robot.kinematics.half_track_m;
  p.com_offset_m = robot.kinematics.com_offset_m;
  p.chassis_kg = robot.mass.chassis_kg;
  p.wheel_kg = robot.mass.wheel_kg;
  p.yaw_inertia_kg_m2 = robot.mass.yaw_inertia_kg_m2;
  p.payload_yaw_inertia_m2 = robot.mass.payload_yaw_inertia_m2.value_or(robot::payload_yaw_inertia_m2);
  p.wheel_inertia_kg_m2 = robot.mass.wheel_inertia_kg_m2 + robot.motor.rotor_inertia_kg_m2;
  p.friction_torque_nm = {S(robot.motor.friction_torque_nm[0]), S(robot.motor.friction_torque_nm[1])};
  p.viscous_friction_nm_s_rad = robot.motor.viscous_friction_nm_s_rad;
  p.torque_constant_nm_a = robot.motor.torque_constant_nm_a * robot.motor.gear_ratio;
  p.voltage_constant_v_s_rad = robot.motor.voltage_constant_v_s_rad * robot.motor.gear_ratio;
  p.resistance_ohm = {S(robot.motor.resistance_ohm), S(robot.motor.resistance_ohm)};
  p.idle_power_w = robot.idle_power_w;
  p.battery_resistance_ohm = robot.battery.internal_resistance_ohm;
  p.battery_voltage_v = robot.battery.nominal_voltage_v;
  return p;
}

}  // namespace joulecast::dynamics
