#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct CoulombFriction {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.9, 20, "extra internal dry friction over the nominal T_m of each side"}});
  static constexpr EffectInfo info{"coulomb_friction",
                                   ActsOn::wheel_torque,
                                   "T = (1 + a) T_m sgn(w)",
                                   "any speed above creep",
                                   "thesis (2-32), T_m; FACTS, notation",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    for (S& torque : p.friction_torque_nm) torque *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
