#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct Slope {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"angle_rad", "rad", 0, 0, 0.3, "tilt of the floor"},
                                      {"uphill_rad", "rad", 0, -7, 7, "heading in which the floor rises"}});
  static constexpr EffectInfo info{"slope",
                                   ActsOn::wheel_torque,
                                   "F = m g sin(a) cos(heading - b)",
                                   "a plane floor, small tilt",
                                   "thesis (1-3), F_g = m g sin(alpha)",
                                   parameters,
                                   false,
                                   true};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    if (!std::isfinite(c.at.heading_rad)) return;
    c.force(loads, Load::potential, c.weight_n * sin(a[0]) * cos(S(c.at.heading_rad) - a[1]));
  }
};

}  // namespace joulecast::dynamics
