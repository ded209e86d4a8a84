#pragma once

#include <array>

#include "robot/robot_model.h"

namespace joulecast::samples {

// The thesis's Nomad Super Scout, tables 3-1 and 3-2, with values derived in FACTS and a suitable battery and
// limits.
inline robot::RobotModel nomad() {
  robot::RobotModel r;
  r.robot_id = "nomad";
  r.kinematics = {.wheel_radius_m = 0.1, .half_track_m = 0.165, .com_offset_m = 0};
  r.mass = {.chassis_kg = 21.2, .wheel_kg = 1.39, .yaw_inertia_kg_m2 = 0.75, .wheel_inertia_kg_m2 = 0.028};
  r.motor = {.resistance_ohm = 2.74,
             .inductance_h = 0.0026,
             .torque_constant_nm_a = 0.069,
             .voltage_constant_v_s_rad = 0.069,
             .gear_ratio = 24.9,
             .rotor_inertia_kg_m2 = 0,
             .viscous_friction_nm_s_rad = 0.0017,
             .friction_torque_nm = {0.3728, 0.346}};
  r.battery.nominal_voltage_v = 24;
  r.battery.capacity_ah = 18;
  r.battery.internal_resistance_ohm = 0.08;
  r.battery.reserve_fraction = 0.15;
  r.idle_power_w = 14;
  r.limits = {
      .speed_m_s = 1, .acceleration_m_s2 = 0.35, .yaw_rate_rad_s = 1.5, .current_a = 8, .payload_kg = 10.5};
  return r;
}

// Three more robots with the parameters that planning needs: the thesis's simulated Pioneer P3-DX (FACTS,
// parameters), a mid-size carrier and a tug that carries 250 kg.
inline robot::RobotModel p3dx() {
  robot::RobotModel r;
  r.robot_id = "p3dx";
  r.kinematics = {0.095, 0.165, 0};
  r.mass = {6.04, 1.48, 0.25, 0};
  r.motor = {0.7, 0, 0.88, 0.88, 1, 0.0713, 0.039, {0, 0}};
  r.battery.nominal_voltage_v = 12.6;
  r.idle_power_w = 6;
  r.limits = {1.2, 0.5, 2.0, 12, 7.6};
  return r;
}

inline robot::RobotModel amr() {
  robot::RobotModel r;
  r.robot_id = "amr";
  r.kinematics = {0.0825, 0.21, 0};
  r.mass = {62, 3.1, 4.2, 0.052};
  r.motor = {0.36, 0.0004, 0.056, 0.056, 21, 0, 0.021, {0.85, 0.92}};
  r.battery.nominal_voltage_v = 25.6;
  r.idle_power_w = 24;
  r.limits = {1.5, 0.6, 1.8, 30, 60};
  return r;
}

inline robot::RobotModel tug() {
  robot::RobotModel r;
  r.robot_id = "tug";
  r.kinematics = {0.125, 0.29, 0};
  r.mass = {135, 5.5, 14, 0.11};
  r.motor = {0.21, 0.00025, 0.071, 0.071, 28, 0, 0.034, {1.9, 1.75}};
  r.battery.nominal_voltage_v = 51.2;
  r.idle_power_w = 45;
  r.limits = {1.4, 0.5, 1.2, 40, 250};
  return r;
}

inline std::array<robot::RobotModel, 4> all_robots() {
  return {nomad(), p3dx(), amr(), tug()};
}

}  // namespace joulecast::samples
