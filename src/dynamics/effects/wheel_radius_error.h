#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct WheelRadiusError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.5, 0.5, "error of both radii over the nominal one"}});
  static constexpr EffectInfo info{
      "wheel_radius_error",
      ActsOn::kinematics,
      "r (1 + a), both wheels",
      "worn or soft tyres",
      "Borenstein and Feng, Measurement and correction of systematic odometry errors, 1996",
      parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    for (S& radius : p.wheel_radius_m) radius *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
