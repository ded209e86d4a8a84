#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct ResistanceError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.99, 20, "error of the armature resistance over its nominal value"}});
  static constexpr EffectInfo info{"resistance_error",     ActsOn::motor,      "R (1 + a)",
                                   "constant temperature", "thesis (2-32), R", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    for (S& ohm : p.resistance_ohm) ohm *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
