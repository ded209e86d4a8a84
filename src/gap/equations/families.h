#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "gap/equations/channels.h"

namespace joulecast::gap {

// What the variables of a set of recordings range over; outside families are functions of scaled variables.
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

// A flexible set of functions of one variable in one kind of channel: it stands for "something that the
// catalogue does not know, that follows this variable". Values are of order one.
struct OutsideFamily {
  std::string_view variable;
  Channel channel;  // the right-hand one of a pair
  std::size_t size = 0;
  // Writes `size` values for one window; `side` is 0 or 1 in paired channels.
  void (*values)(const Window&, const Ranges&, std::size_t side, std::span<double> out) = nullptr;
};

// The families that these recordings can speak of.
std::vector<OutsideFamily> outside_families(const Ranges& ranges, const FromMotion& from_motion);

}  // namespace joulecast::gap
