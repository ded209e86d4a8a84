#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct WindingTemperature {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"thermal_resistance_k_w", "K/W", 0, 0, 300, "winding over ambient"},
                                      {"time_constant_s", "s", 600, 10, 7200, "of the winding"}});
  static constexpr EffectInfo info{
      "winding_temperature",
      ActsOn::motor,
      "R (1 + 0.00393 a q), q = R i^2 low-passed over b",
      "one thermal mass for each winding",
      "copper: 0.393 % per kelvin; Hughes and Drury, Electric Motors and Drives, ch. 3",
      parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.thermal_resistance_k_w += a[0];
    p.thermal_time_constant_s = value_of(a[1]);
  }
};

}  // namespace joulecast::dynamics
