#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct YawInertiaError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.9, 20,
        "error of the robot file's yaw inertia over its value; a payload's is not scaled"}});
  static constexpr EffectInfo info{"yaw_inertia_error", ActsOn::inertia,    "I (1 + a)",
                                   "rigid body",        "thesis (2-12), I", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.yaw_inertia_kg_m2 *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
