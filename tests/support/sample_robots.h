#pragma once

#include "robot/robot_model.h"

namespace joulecast::testing {

// The thesis's Nomad Super Scout, tables 3-1 and 3-2, with the values that FACTS derives; a battery and
// limits that suit it.
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

}  // namespace joulecast::testing
