#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"

namespace joulecast::virtual_robot {

// The plant's parameters from a robot file. The plant has its own reader of the file: the model under test
// must not supply the parameters of the plant that is to contradict it. Sides: [0] right, [1] left.
struct RobotParameters {
  std::string robot_id;
  double wheel_radius_m = 0;
  double half_track_m = 0;
  double com_offset_m = 0;
  double chassis_kg = 0;
  double wheel_kg = 0;
  double yaw_inertia_kg_m2 = 0;
  double payload_yaw_inertia_m2 = 0;  // that each kilogram of payload adds
  double wheel_inertia_kg_m2 = 0;     // wheel and rotor together, at the wheel
  double resistance_ohm = 0;
  double inductance_h = 0;
  double torque_constant_nm_a = 0;
  double voltage_constant_v_s_rad = 0;
  double gear_ratio = 1;
  double viscous_friction_nm_s_rad = 0;
  std::array<double, 2> friction_torque_nm{};
  double nominal_voltage_v = 0;
  double capacity_ah = 0;
  double internal_resistance_ohm = 0;
  std::vector<std::pair<double, double>>
      open_circuit_voltage;  // (charge 0..1, V); empty: the plant's own curve
  double idle_power_w = 0;
  double speed_limit_m_s = 0;
  double acceleration_limit_m_s2 = 0;
  double yaw_rate_limit_rad_s = 0;
  double current_limit_a = 0;
  double payload_limit_kg = 0;
};

// From the text of a robot file. Fault::invalid names the JSON pointer at fault. A robot file with adopted
// effects is rejected: the plant's imperfections are given separately, never through the model.
[[nodiscard]] Result<RobotParameters> parse_robot(const std::string& json_text);

}  // namespace joulecast::virtual_robot
