#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct SensorDelay {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"delay_s", "s", 0, -0.5, 0.5, "by which electrical channels lag the encoders"}});
  static constexpr EffectInfo info{"sensor_delay",
                                   ActsOn::sensors,
                                   "electrical reading(t) = truth(t - a)",
                                   "delay below the time constants of motion",
                                   "Ljung, System Identification, section 14.5",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.sensor_delay_s += a[0];
  }
};

}  // namespace joulecast::dynamics
