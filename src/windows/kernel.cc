#include "windows/kernel.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace joulecast::windows {

Kernel::Kernel(std::span<const double> time_s, std::size_t first, std::size_t last, double centre_s,
               double length_s)
    : first_(first), weight_(last - first), slope_(last - first) {
  double total = 0, mean_slope = 0;
  for (std::size_t k = first; k < last; ++k) {
    const double before = k > 0 ? time_s[k] - time_s[k - 1] : time_s[k + 1] - time_s[k];
    const double after = k + 1 < time_s.size() ? time_s[k + 1] - time_s[k] : before;
    const double cell = 0.5 * (std::min(before, length_s) + std::min(after, length_s));
    const double u = 2 * std::numbers::pi * (time_s[k] - centre_s) / length_s;
    weight_[k - first] = cell * (1 + std::cos(u));
    slope_[k - first] = cell * std::sin(u);
    total += weight_[k - first];
    mean_slope += slope_[k - first];
  }
  for (double& w : weight_) w /= total;
  double gain = 0;
  for (std::size_t k = first; k < last; ++k) {
    const double third = 3 * (time_s[k] - centre_s) / length_s;
    part_.push_back(third < -0.5 ? 0 : third > 0.5 ? 2 : 1);
    part_weight_[part_.back()] += weight_[k - first];
    slope_[k - first] -= mean_slope * weight_[k - first];
    gain += slope_[k - first] * (time_s[k] - centre_s);
  }
  for (double& s : slope_) s /= gain;
}

double Kernel::mean_of_part(std::size_t part, std::span<const double> v) const {
  double total = 0;
  for (std::size_t k = 0; k < weight_.size(); ++k)
    if (part_[k] == part) total += weight_[k] * v[first_ + k];
  return part_weight_[part] > 0 ? total / part_weight_[part] : 0;
}

double Kernel::sum(const std::vector<double>& weights, std::span<const double> v) const {
  double total = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) total += weights[k] * v[first_ + k];
  return total;
}

}  // namespace joulecast::windows
