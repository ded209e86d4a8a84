#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct Inductance {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"inductance_h", "H", 0, 0, 1, "armature inductance"}});
  static constexpr EffectInfo info{
      "inductance", ActsOn::motor, "V + a di/dt", "mean-value drivers", "thesis (2-32), L, dropped in (2-33)",
      parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.inductance_h += a[0];
  }
};

}  // namespace joulecast::dynamics
