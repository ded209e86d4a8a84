#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct GearEfficiency {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"loss", "1", 0, 0, 0.9, "fraction of the transmitted torque lost"}});
  static constexpr EffectInfo info{
      "gear_efficiency",
      ActsOn::wheel_torque,
      "T = tau + a |tau| sgn(w), tau the torque that the gear passes on",
      "steady mesh; driving and braking alike",
      "Giberti, Cinquemani and Legnani, Effects of transmission mechanical characteristics, 2010",
      parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.gear_loss += a[0];
    p.gear_friction_share = a[1];
  }
};

}  // namespace joulecast::dynamics
