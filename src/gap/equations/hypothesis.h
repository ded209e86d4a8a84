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
  std::size_t parameter = 0;      // parameter of the first column's coefficient
  std::string covariate;          // name of the covariate that the strength follows; empty: it is constant
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
