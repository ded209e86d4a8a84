#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
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

// Every other value, from the one of number `first` on (0 or 1); those between are replaced by straight lines
// where all three were measured. The two halves of a channel have no noise in common that is independent from
// sample to sample.
std::vector<double> half_of(std::span<const double> time_s, std::vector<double> v, std::size_t first);

// The median time between samples [s], of which there are at least two.
double median_period_s(const telemetry::Recording& mission);

Track make_track(const telemetry::Recording& mission, const robot::RobotModel& robot,
                 std::span<const std::string> covariates, double period_s, const WindowSettings& settings);

// Longest time between samples inside a window or a row of power.
inline double longest_gap_s(double period_s, const WindowSettings& settings = {}) {
  return std::max(settings.longest_gap_s, 2.5 * period_s);
}

inline constexpr double fewest_rows = 4;       // a window lasts, as its outermost have no weight
inline constexpr double moving_rad_s = 0.10;   // slowest wheel that surely turns
inline constexpr double resting_rad_s = 0.03;  // fastest wheel that surely stands
// Turned since it stood, from which on a wheel slides: before that dry friction builds up as contacts bend
// (Canudas de Wit and others 1995).
inline constexpr double sliding_rad = 0.1;

// A smooth window (raised cosine) over samples first <= k < last: weights for means, and weights that give
// the slope of a channel without differentiating it, -integral of phi' v (weak form).
class Kernel {
 public:
  static constexpr std::size_t parts = 3;  // begin, middle and end of the window

  Kernel(std::span<const double> time_s, std::size_t first, std::size_t last, double centre_s,
         double length_s);

  double mean(std::span<const double> v) const { return sum(weight_, v); }
  // Gain one on a straight line, zero on a constant.
  double slope(std::span<const double> v) const { return sum(slope_, v); }
  // Share of each part in the mean; 0 where it has no samples.
  const std::array<double, parts>& part_weight() const { return part_weight_; }
  double mean_of_part(std::size_t part, std::span<const double> v) const;

 private:
  double sum(const std::vector<double>& weights, std::span<const double> v) const;

  std::size_t first_;
  std::vector<double> weight_, slope_;
  std::vector<std::size_t> part_;  // of each sample
  std::array<double, parts> part_weight_{};
};

}  // namespace joulecast::windows
