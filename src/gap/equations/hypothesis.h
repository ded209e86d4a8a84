#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "gap/equations/cause.h"
#include "statistics/evidence.h"

namespace joulecast::gap {

// One regressor: how the equations answer to one coefficient, and what is expected of it beforehand.
struct Column {
  double tolerance = 0;    // sd of the coefficient in a robot that is as its file says
  double scatter = 0;      // sd between missions; 0: none
  double discrepancy = 0;  // sd of the coefficient where formulas are off by all of the mean power
  double power_share = 0;  // mean |change| of battery power for a coefficient of one, over its mean
  double motor_share = 0;  // the same of what the motors' sensors read
};

using HypothesisSet = std::vector<std::size_t>;  // ascending indices of hypotheses

inline HypothesisSet with(HypothesisSet set, std::size_t h) {
  set.insert(std::ranges::lower_bound(set, h), h);
  return set;
}
inline HypothesisSet without(HypothesisSet set, std::size_t h) {
  std::erase(set, h);
  return set;
}

// Something that may be there: an effect of the catalogue (one variant of its shapes), a covariate, or a
// family of functions that stands for what the catalogue does not know. Recordings, tables of runs and
// comparisons between groups share this vocabulary.
struct Hypothesis {
  statistics::Candidate candidate;
  dynamics::ActiveEffect effect;  // strength as in the robot file's model; null effect: of no effect
  std::size_t parameter = 0;      // whose coefficient the first column has
  std::string covariate;          // name of what the effect's strength follows; empty: it stands still
  std::string unit;               // of a covariate's coefficient
  std::optional<Modulation> by;   // the covariate in recordings
  std::string channel, variable;  // outside only
  bool one_shape = false;         // variants are one thing in other shapes

  bool is_effect() const { return effect.effect != nullptr && covariate.empty(); }
  bool outside() const { return effect.effect == nullptr && covariate.empty(); }
  Cause cause() const { return {effect, parameter, by}; }
  std::string id() const {
    if (is_effect()) return std::string(effect.effect->info().id);
    return outside() ? "outside:" + channel + ":" + variable : "covariate:" + covariate;
  }
  // Whether both are one cause, of which only one variant can hold.
  bool excludes(const Hypothesis& other) const;
};

}  // namespace joulecast::gap
