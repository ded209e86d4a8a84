#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct TurningScrub {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"coefficient", "1", 0, 0, 3, "friction coefficient of the twisting contacts"},
       {"rate_rad_s", "rad/s", 0.02, 0.001, 2, "yaw rate at which the moment has built up"}});
  static constexpr EffectInfo info{
      "turning_scrub",
      ActsOn::wheel_torque,
      "M = a (m g l / 2) tanh(yaw / b), opposing the turn",
      "tyres and castors twisting on the floor; saturated above creeping yaw rates",
      "Morales et al., Power analysis for a skid-steered tracked mobile robot, 2006",
      parameters};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    c.moment(loads, Load::scrub,
             a[0] * c.weight_n * c.parameters.half_track_m * 0.5 * tanh(c.body.yaw_rate_rad_s / a[1]));
  }
};

}  // namespace joulecast::dynamics
