#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct BatteryResistance {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.9, 20, "error of the internal resistance over its nominal value"}});
  static constexpr EffectInfo info{"battery_resistance",
                                   ActsOn::battery_side,
                                   "V_t = V_oc - (1 + a) R_b i",
                                   "ohmic part only",
                                   "Plett, Battery Management Systems I, ch. 2",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.battery_resistance_ohm *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
