#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "dynamics/drive_model.h"
#include "planning/problem.h"

namespace joulecast::planning {

struct BrokenLimit {
  std::string_view
      limit;  // speed m/s, acceleration m/s^2, yaw_rate rad/s, wheel_speed rad/s, current A, voltage V
  double reached = 0;
  double allowed = 0;
};

// Faster, less than 6e-4 of the dry friction is missing.
inline constexpr double creep_rad_s = 30 * dynamics::friction_width_rad_s;

// Share by which the motors' limits may be exceeded between rows, where the acceleration is constant.
inline constexpr double over_between_rows = 5e-5;

// Whether both wheels turn so slowly that their dry friction, which the drive model smooths through
// standstill, is missing: the computed motor loads are then too low.
bool creeps(const std::array<double, 2>& wheel_speed_rad_s);

// The peak values of a motion, for every quantity that a limit bounds.
struct Peaks {
  double peak_speed_m_s = 0;
  double peak_acceleration_m_s2 = 0;  // along the way; turning in place, of the wheels' rims
  double peak_yaw_rate_rad_s = 0;
  double peak_wheel_speed_rad_s = 0;
  double peak_current_a = 0, peak_voltage_v = 0;  // of the armatures

  void reach(const Peaks& other);
  // Includes wheels and armatures at an instant; armatures only unless the wheels creep.
  void reach(const std::array<double, 2>& wheel_speed_rad_s, const dynamics::PowerFlow<double>& flow);
  // The limits broken by more than rounding, in the order above: by 1e-6 of them; acceleration, current and
  // voltage, which depend on the slope of rounded speeds, by 1.5e-3.
  std::vector<BrokenLimit> beyond(const Limits& limits) const;
};

}  // namespace joulecast::planning
