#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct CurrentSensorGain {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"gain", "1", 0, -0.5, 0.5, "error of the reading"},
                                      {"motors", "1", 1, 0, 1, "share that the motor sensors have of it"},
                                      {"battery", "1", 1, 0, 1, "share that the battery sensor has of it"}});
  static constexpr EffectInfo info{"current_sensor_gain",
                                   ActsOn::sensors,
                                   "reading = (1 + a) truth",
                                   "linear sensors",
                                   "ISO/IEC Guide 98-3 (GUM), systematic effects",
                                   parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.motor_current.gain += a[0] * a[1];
    p.battery_current.gain += a[0] * a[2];
  }
};

}  // namespace joulecast::dynamics
