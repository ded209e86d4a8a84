#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct NoRegeneration {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"fraction", "1", 0, 0, 1, "of the braking power that is not returned"}});
  static constexpr EffectInfo info{"no_regeneration",
                                   ActsOn::battery_side,
                                   "braking power of each motor reaches the battery as (1 - a)",
                                   "a = 1: all burnt in a resistor or blocked",
                                   "the thesis returns all of it, (2-46)",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.unreturned += a[0];
  }
};

}  // namespace joulecast::dynamics
