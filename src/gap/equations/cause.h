#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "dynamics/catalogue.h"
#include "windows/windows.h"

namespace joulecast::gap {

using windows::missing;
using windows::Window;

// A further variable that a cause follows: a covariate, by its distance from `centre`.
struct Modulation {
  std::size_t covariate = 0;  // index in Window::covariates
  double centre = 0;

  // 0 where the covariate is missing, as if it were at its centre.
  double of(const Window& w) const {
    const double value = covariate < w.covariates.size() ? w.covariates[covariate] : missing;
    return std::isfinite(value) ? value - centre : 0;
  }
};

// The origin of a covariate: 0 of an amount, which is never negative and comes near 0 relative to its range,
// such as a load in W or a share of a processor; else its median. Needs at least one value.
double centre_of(std::vector<double> known);

// Each covariate that is finite in at least half of the windows and differs among them.
std::vector<Modulation> modulations_of(std::span<const Window> windows);

// A cause found, with its strength: an effect in force, or an effect with parameter `parameter` as its
// strength per unit of a covariate.
struct Cause {
  dynamics::ActiveEffect effect;
  std::size_t parameter = 0;
  std::optional<Modulation> by;
};

}  // namespace joulecast::gap
