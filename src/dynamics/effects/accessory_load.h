#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct AccessoryLoad {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"power_w", "W", 0, -2000, 20000, "extra constant power"}});
  static constexpr EffectInfo info{
      "accessory_load",
      ActsOn::battery_side,
      "P + a",
      "constant while the robot is on",
      "Mei et al., Deployment of mobile robots with energy and timing constraints, 2006",
      parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.accessory_power_w += a[0];
  }
};

}  // namespace joulecast::dynamics
