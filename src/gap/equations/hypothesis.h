#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "gap/equations/cause.h"
#include "statistics/evidence.h"

namespace joulecast::gap {

// An effect of the catalogue in one variant of its shapes, or a covariate.
struct Hypothesis {
  statistics::Candidate candidate;
  dynamics::ActiveEffect effect;  // strength as in the robot file's model; with a covariate, its carrier
  std::size_t parameter = 0;      // whose coefficient the first column has
  std::string covariate;          // name of what the effect's strength follows; empty: it stands still
  std::string unit;               // of a covariate's coefficient
  std::optional<Modulation> by;   // the covariate in recordings

  bool is_effect() const { return effect.effect != nullptr && covariate.empty(); }
  Cause cause() const { return {effect, parameter, by}; }
  std::string id() const {
    if (is_effect()) return std::string(effect.effect->info().id);
    return "covariate:" + covariate;
  }
};

}  // namespace joulecast::gap
