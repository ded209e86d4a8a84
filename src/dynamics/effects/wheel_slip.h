#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct WheelSlip {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"slip", "1", 0, -0.2, 0.8, "part of the wheel travel that moves nothing"}});
  static constexpr EffectInfo info{"wheel_slip",
                                   ActsOn::kinematics,
                                   "v = (1 - a) r w",
                                   "small constant slip of both wheels",
                                   "Wong, Theory of Ground Vehicles, section 1.3",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.slip += a[0];
  }
};

}  // namespace joulecast::dynamics
