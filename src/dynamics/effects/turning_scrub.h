#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct TurningScrub {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"coefficient", "1", 0, 0, 3, "friction coefficient of the twisting contacts"}});
  static constexpr EffectInfo info{
      "turning_scrub",
      ActsOn::wheel_torque,
      "M = a m g l / 2 opposing the turn",
      "tyres and castors twisting on the floor; saturated at all but creeping yaw rates",
      "Morales et al., Power analysis for a skid-steered tracked mobile robot, 2006; FACTS, open points",
      parameters};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    constexpr double width_rad_s = 0.002;
    c.moment(loads, Load::scrub,
             a[0] * c.weight_n * c.parameters.half_track_m * 0.5 *
                 smooth_sign(c.body.yaw_rate_rad_s, width_rad_s));
  }
};

}  // namespace joulecast::dynamics
