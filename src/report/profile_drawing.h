#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace joulecast::report {

// One motion over time; all columns are as long.
struct DrawnMotion {
  std::string label;
  std::string_view style;  // plan, trapezoid or triangle
  std::vector<double> time_s, speed_m_s, yaw_rate_rad_s, power_w, energy_j;
};

// Speed where a motion drives, yaw rate where one turns, power and energy over time, as an SVG document. The
// first motion is drawn on top. There is at least one, with at least two instants.
std::string draw_profile(std::string_view heading, std::span<const DrawnMotion> motions);

// Round values that span a range.
std::vector<double> ticks_of(double low, double high, int about);

}  // namespace joulecast::report
