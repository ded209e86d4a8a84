#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct DriverLoss {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"fraction", "1", 0, 0, 1, "of the absolute motor power"}});
  static constexpr EffectInfo info{"driver_loss",
                                   ActsOn::battery_side,
                                   "P + a |V i| for each motor",
                                   "switching and conduction losses together",
                                   "Mohan, Undeland and Robbins, Power Electronics, ch. 2",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.driver_loss += a[0];
  }
};

}  // namespace joulecast::dynamics
