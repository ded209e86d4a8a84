#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct WheelRadiusAsymmetry {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.5, 0.5, "difference of the radii over the nominal one"}});
  static constexpr EffectInfo info{"wheel_radius_asymmetry",
                                   ActsOn::kinematics,
                                   "r_right (1 + a/2), r_left (1 - a/2)",
                                   "unequal wear or load",
                                   "Borenstein and Feng 1996, E_d",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.wheel_radius_m[0] *= S(1) + a[0] * 0.5;
    p.wheel_radius_m[1] *= S(1) - a[0] * 0.5;
  }
};

}  // namespace joulecast::dynamics
