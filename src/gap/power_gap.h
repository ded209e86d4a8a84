#pragma once

#include <span>
#include <vector>

#include "gap/columns.h"

namespace joulecast::gap {

// Battery power of every window [W]; NaN where the battery is not measured.
std::vector<double> measured_power(std::span<const Window> windows);
// By the robot file, its adopted effects and these, as the robot's meter would read it.
std::vector<double> modelled_power(const robot::RobotModel& robot,
                                   std::span<const dynamics::ActiveEffect> effects,
                                   std::span<const Window> windows);

// The drive model of the robot file, its adopted effects (none where the catalogue rejects one) and these.
dynamics::DriveModel extended_model(const robot::RobotModel& robot,
                                    std::span<const dynamics::ActiveEffect> effects);

struct GapSize {
  double energy_relative = 0;
  double absolute_relative = 0;
};

GapSize gap_size(std::span<const double> measured_w, std::span<const double> modelled_w);

// The absolute relative gap that measurement noise alone makes, from second differences of the residual.
double noise_floor(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> modelled_w);

// Shapley shares of the effects in the integral of |measured - modelled|; 0 beyond the sixth effect.
std::vector<double> effect_shares(const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects,
                                  std::span<const Window> windows, std::span<const double> measured_w);

}  // namespace joulecast::gap
