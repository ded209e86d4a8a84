#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct LoadRollingResistance {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"coefficient", "1", 0, 0, 0.3, "rolling resistance of the payload weight"}});
  static constexpr EffectInfo info{
      "load_rolling_resistance",
      ActsOn::wheel_torque,
      "F = a m_p g, half on each wheel, opposing its rotation",
      "hard floor, payload over the axle",
      "thesis (1-3), F_r = m g f_r; tables 3-3 and 3-4 show that T_m grows with payload",
      parameters};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    for (std::size_t s : {0u, 1u})
      loads.wheel(Load::rolling, s,
                  a[0] * c.payload_weight_n * c.parameters.wheel_radius_m[s] * 0.5 * c.direction[s]);
  }
};

}  // namespace joulecast::dynamics
