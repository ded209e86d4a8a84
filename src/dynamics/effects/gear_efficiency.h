#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct GearEfficiency {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"loss", "1", 0, 0, 0.9, "fraction of the transmitted torque lost"},
                                      {"of_friction", "1", 0, 0, 1,
                                       "share of T_m and viscous friction that the gear passes on: 0 where "
                                       "they act at the motor, 1 where at the wheel"}});
  static constexpr EffectInfo info{
      "gear_efficiency",
      ActsOn::wheel_torque,
      "T = tau + f + a |tau + b f| sgn(w), tau the torque passed on, f the drive's own friction",
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
