#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

// Common to the gains of current and of voltage sensors.
inline constexpr std::array sensor_gain_parameters =
    std::to_array<EffectParameter>({{"gain", "1", 0, -0.5, 0.5, "error of the reading"},
                                    {"motors", "1", 1, 0, 1, "share that the motor sensors have of it"},
                                    {"battery", "1", 1, 0, 1, "share that the battery sensor has of it"}});

constexpr EffectInfo sensor_gain_info(std::string_view id) {
  return {id,
          ActsOn::sensors,
          "reading = (1 + a) truth",
          "linear sensors",
          "ISO/IEC Guide 98-3 (GUM), systematic effects",
          sensor_gain_parameters};
}

}  // namespace joulecast::dynamics
