#pragma once

#include <span>
#include <vector>

#include "gap/columns.h"

namespace joulecast::gap {

// Measured and modelled battery power of every window [W]; NaN where the battery is not measured.
struct PowerSeries {
  std::vector<double> measured_w, modelled_w;
};

std::vector<double> measured_power(std::span<const Window> windows);
std::vector<double> modelled_power(const robot::RobotModel& robot,
                                   std::span<const dynamics::ActiveEffect> effects,
                                   std::span<const Window> windows);

struct GapSize {
  double energy_relative = 0;
  double absolute_relative = 0;
};

GapSize gap_size(std::span<const double> measured_w, std::span<const double> modelled_w);

// The absolute relative gap that measurement noise alone makes, from second differences of the residual.
double noise_floor(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> modelled_w);

// Shapley values of the effects: how much each, on average over the orders of adding them, takes off the
// integral of |measured - modelled|, over that integral without any. At most 6 effects.
std::vector<double> shapley_shares(const robot::RobotModel& robot,
                                   std::span<const dynamics::ActiveEffect> effects,
                                   std::span<const Window> windows, std::span<const double> measured_w);

}  // namespace joulecast::gap
