#pragma once

#include <algorithm>

#include "statistics/distributions.h"

// Scatter of ratios of energy by chance; for the sources of this folder.
namespace joulecast::drift {

inline constexpr double gaussian_mad = 1.4826;  // standard deviations of a normal in its median deviation
inline constexpr double least_scatter =
    0.002;  // of a mission's ratio: rounding and conditions that are not logged
inline constexpr double false_alarm = 0.01;  // of a segment without a change, and of equal robots

// The value that |t| exceeds with `probability`; a shorter segment counts as one of 2 degrees of freedom.
inline double threshold(double probability, double freedom) {
  return statistics::student_t_quantile(1 - probability / 2, std::max(freedom, 2.0));
}

}  // namespace joulecast::drift
