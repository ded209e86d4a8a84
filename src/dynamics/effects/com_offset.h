#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct ComOffset {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"offset_m", "m", 0, -1, 1, "centre of mass further ahead of the axle"}});
  static constexpr EffectInfo info{
      "com_offset",       ActsOn::inertia, "d + a", "centre of mass on the axis of symmetry",
      "thesis (2-12), d", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.com_offset_m += a[0];
  }
};

}  // namespace joulecast::dynamics
