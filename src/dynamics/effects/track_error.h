#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct TrackError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.7, 2, "error of the track over its nominal value"}});
  static constexpr EffectInfo info{"track_error",
                                   ActsOn::kinematics,
                                   "l (1 + a)",
                                   "effective contact width",
                                   "Borenstein and Feng 1996, E_b",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.half_track_m *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
