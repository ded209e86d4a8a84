#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct AerodynamicDrag {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"coefficient_n_s2_m2", "N s^2/m^2", 0, 0, 1000, "drag over speed squared"}});
  static constexpr EffectInfo info{"aerodynamic_drag", ActsOn::wheel_torque, "F = a v |v|, a = rho A C / 2",
                                   "still air",        "thesis (1-3), F_a",  parameters};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    const S v = c.body.speed_m_s;
    c.force(loads, Load::drag, a[0] * v * abs(v));
  }
};

}  // namespace joulecast::dynamics
