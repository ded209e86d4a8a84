#pragma once

#include <span>

#include "gap/equations/channels.h"

namespace joulecast::gap {

// Largest sizes and ranges of the variables of a set of recordings.
struct Ranges {
  double mean_power_w = 1, mean_wheel_speed_rad_s = 0;
  bool power = false;  // of the battery or the motors was measured; otherwise the mean is the robot file's
  double speed_m_s = 1, wheel_speed_rad_s = 1, acceleration_m_s2 = 1, yaw_rate_rad_s = 1, payload_kg = 1;
  double duration_s = 1, current_a = 1, battery_current_a = 1, battery_voltage_step_v = 0;
  double x_low_m = 0, x_high_m = 1, y_low_m = 0, y_high_m = 1;
  bool position = false, heading = false, climb = false, payload_varies = false;
  double wheel_radius_m = 1, half_track_m = 1, idle_power_w = 0;
};

Ranges ranges_of(std::span<const Window> windows, const robot::RobotModel& robot);

}  // namespace joulecast::gap
