#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct Grade {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"share", "1", 0, 0, 2, "of the climb's force that counts; 1: the whole of it"},
       {"zero_rad", "rad", 0, -0.2, 0.2, "added to the climb: by how much the pitch reads low"}});
  static constexpr EffectInfo info{"grade",
                                   ActsOn::wheel_torque,
                                   "F = a m g sin(climb + b)",
                                   "a floor of any shape whose climb is known: pitch, or height over the way",
                                   "thesis (1-3), F_g = m g sin(alpha)",
                                   parameters,
                                   false,
                                   false,
                                   true};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    if (!std::isfinite(c.at.climb_rad)) return;
    c.force(loads, Load::potential, a[0] * c.weight_n * sin(S(c.at.climb_rad) + a[1]));
  }
};

}  // namespace joulecast::dynamics
