#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct BrushDrop {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"voltage_v", "V", 0, 0, 20, "across both brushes"}});
  static constexpr EffectInfo info{"brush_drop",
                                   ActsOn::motor,
                                   "V + a sgn(i)",
                                   "brushed motors",
                                   "Hughes and Drury, Electric Motors and Drives, section 3.3",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.brush_drop_v += a[0];
  }
};

}  // namespace joulecast::dynamics
