#pragma once

#include "dynamics/effect.h"
#include "dynamics/stribeck_curve.h"

namespace joulecast::dynamics {

struct StribeckFriction {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, 0, 20,
        "breakaway friction above T_m, over T_m with coulomb_friction and friction_asymmetry"},
       {"speed_rad_s", "rad/s", 2, 0.2, 100, "Stribeck speed of the wheel"},
       {"exponent", "1", 2, 1, 2, "of the speed in the exponential"}});
  static constexpr EffectInfo info{"stribeck_friction",
                                   ActsOn::wheel_torque,
                                   "T = a T_m exp(-|w/w_s|^d) sgn(w)",
                                   "low speed, boundary lubrication",
                                   "Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2",
                                   parameters};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    for (std::size_t s : {0u, 1u}) {
      const S x = S(c.at.wheel_speed_rad_s[s]) / a[1];
      loads.wheel(Load::internal, s,
                  a[0] * c.parameters.friction_torque_nm[s] * stribeck_curve(x, a[2]) * c.direction[s]);
    }
  }
};

}  // namespace joulecast::dynamics
