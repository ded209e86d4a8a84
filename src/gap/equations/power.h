#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "gap/equations/channels.h"

namespace joulecast::gap {

// What a cause follows beside what its effect follows: a covariate, by how far it is from `centre`.
struct Modulation {
  std::size_t covariate = 0;  // index in Window::covariates
  double centre = 0;

  // 0 where the covariate is not known, as if it were at its centre.
  double of(const Window& w) const;
};

// Something found, with its strength: an effect in force, or one whose strength, parameter `parameter`, is so much a
// unit of a covariate.
struct Cause {
  dynamics::ActiveEffect effect;
  std::size_t parameter = 0;
  std::optional<Modulation> by;
};

// Battery power of every window [W]; NaN where the battery was not read. `of_motors`: what the motors take and the
// idle power of the robot file in its place.
std::vector<double> measured_power(std::span<const Window> windows, const robot::RobotModel& robot, bool of_motors);

// By the robot file with the effects that it has (`adopted`) and these causes in force, as the robot's meter would
// read it.
std::vector<double> modelled_power(const robot::RobotModel& robot, std::span<const dynamics::ActiveEffect> adopted,
                                   std::span<const Cause> causes, std::span<const Window> windows);

struct GapSize {
  double energy_relative = 0;    // (E_measured - E_model) / E_measured
  double absolute_relative = 0;  // integral of |P_measured - P_model| over that of |P_measured|
};

GapSize gap_size(std::span<const double> measured_w, std::span<const double> modelled_w);

}  // namespace joulecast::gap
