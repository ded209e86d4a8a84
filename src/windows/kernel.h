#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace joulecast::windows {

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
