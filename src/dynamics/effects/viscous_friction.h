#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct ViscousFriction {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -1, 200, "extra viscous friction over the nominal nu"},
       {"extra_nm_s_rad", "N m s/rad", 0, -100, 1000, "extra viscous friction of each side, beside that",
        true}});
  static constexpr EffectInfo info{"viscous_friction",       ActsOn::wheel_torque,
                                   "T = ((1 + a) nu + b) w", "lubricated gears and bearings",
                                   "thesis (2-32), nu",      parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.viscous_friction_nm_s_rad = p.viscous_friction_nm_s_rad * (S(1) + a[0]) + a[1];
  }
};

}  // namespace joulecast::dynamics
