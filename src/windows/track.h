#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "robot/robot_model.h"
#include "telemetry/recording.h"
#include "windows/windows.h"

namespace joulecast::windows {

// One mission's channels as columns, with quantities computed from every sample.
struct Track {
  std::vector<double> time_s;  // since the first sample
  std::array<std::vector<double>, 2> speed, smooth_speed, voltage, current, power, power_abs, braking, angle,
      current_sign;
  std::array<std::vector<double>, 2> slid;  // angle turned since the wheel stood [rad]
  std::vector<double> battery_voltage, battery_current, battery_power, yaw_rate, climb, x, y, heading,
      payload, charge;
  std::vector<std::vector<double>> covariates;
  double mean_battery_voltage_v = missing;
  double inductance_h = 0;  // of the robot file
  // Copper heat and mean |wheel speed|, low-passed on every time constant.
  std::array<std::array<std::vector<double>, 2>, heat_time_constants_s.size()> heat;
  std::array<std::vector<double>, motion_time_constants_s.size()> motion;
};

// Straight line through the measured samples within +-half_s of an instant: its value and its slope there;
// NaN with fewer than `fewest` such samples.
struct Line {
  double value = missing, slope = missing;
};
Line line_at(std::span<const double> time_s, std::span<const double> v, double at_s, double half_s,
             double fewest = 3);

// The median time between samples [s], of which there are at least two.
double median_period_s(const telemetry::Recording& mission);

Track make_track(const telemetry::Recording& mission, const robot::RobotModel& robot,
                 std::span<const std::string> covariates, double period_s, const WindowSettings& settings);

inline constexpr double fewest_rows = 4;       // a window lasts, as its outermost have no weight
inline constexpr double moving_rad_s = 0.10;   // slowest wheel that surely turns
inline constexpr double resting_rad_s = 0.03;  // fastest wheel that surely stands
// Turned since it stood, from which on a wheel slides: before that dry friction builds up as contacts bend
// (Canudas de Wit and others 1995).
inline constexpr double sliding_rad = 0.1;

}  // namespace joulecast::windows
