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

// What a cause follows beside what its effect follows: a covariate, by how far it is from `centre`.
struct Modulation {
  std::size_t covariate = 0;  // index in Window::covariates
  double centre = 0;

  // 0 where the covariate is not known, as if it were at its centre.
  double of(const Window& w) const {
    const double value = covariate < w.covariates.size() ? w.covariates[covariate] : missing;
    return std::isfinite(value) ? value - centre : 0;
  }
};

// From where a covariate is counted: 0 of an amount, which is never negative and comes near 0 for how far it
// ranges, as a load in W or a share of a processor; else its median. `known`: its values, one at least.
double centre_of(std::vector<double> known);

// Each covariate that is known in at least half of the windows and differs among them.
std::vector<Modulation> modulations_of(std::span<const Window> windows);

// Something found, with its strength: an effect in force, or one whose strength, parameter `parameter`, is so
// much a unit of a covariate.
struct Cause {
  dynamics::ActiveEffect effect;
  std::size_t parameter = 0;
  std::optional<Modulation> by;

  bool same_kind(const Cause& other) const {
    return effect.effect == other.effect.effect && by.has_value() == other.by.has_value() &&
           (!by || (by->covariate == other.by->covariate && parameter == other.parameter));
  }
};

}  // namespace joulecast::gap
