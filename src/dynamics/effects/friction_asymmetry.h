#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct FrictionAsymmetry {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.9, 20, "extra dry friction of that side over its T_m, coulomb_friction included"},
       {"side", "1", 0, 0, 1, "0 right, 1 left"}});
  static constexpr EffectInfo info{"friction_asymmetry",
                                   ActsOn::wheel_torque,
                                   "T = (1 + a) T_m sgn(w) on one side only",
                                   "one motor or gear worn",
                                   "thesis section 3.1: T_m differs between the sides",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.friction_torque_nm[value_of(a[1]) < 0.5 ? 0 : 1] *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
