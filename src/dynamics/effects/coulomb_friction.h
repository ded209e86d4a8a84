#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct CoulombFriction {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.9, 20, "extra internal dry friction over the nominal T_m of each side"},
       {"extra_nm", "N m", 0, -1000, 10000, "extra internal dry friction of each side, beside that", true}});
  static constexpr EffectInfo info{
      "coulomb_friction",      ActsOn::wheel_torque, "T = ((1 + a) T_m + b) sgn(w)",
      "any speed above creep", "thesis (2-32), T_m", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    for (S& torque : p.friction_torque_nm) torque = torque * (S(1) + a[0]) + a[1];
  }
};

}  // namespace joulecast::dynamics
