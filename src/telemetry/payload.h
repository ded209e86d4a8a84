#pragma once

#include <cmath>

#include "signals/sample.h"

namespace joulecast::telemetry {

// The payload with which a mission's samples are accounted, kg, in their order: the sample's value; if that
// is NaN, the last value of the mission; before the first value, the load declared at the mission's start. A
// robot that leaves its field at 0 and declares a load at the start contradicts itself: such a 0 is treated
// as NaN until a sample of the mission has a load. After that, 0 means that the load was set down.
class MissionPayload {
 public:
  MissionPayload() = default;
  // `declared_kg` at the mission's start, NaN: none. `told`: earlier samples had a load or a valid 0.
  explicit MissionPayload(double declared_kg, bool told = false) : kg_(declared_kg), told_(told) {}

  // Whether the sample's 0 contradicts the mission's start.
  bool contradicts(double said_kg) const { return said_kg == 0 && !told_ && kg_ > 0; }

  // NaN: the sample, the samples before it and the start contain no payload.
  double take(double said_kg) {
    if (std::isnan(said_kg) || contradicts(said_kg)) return kg_;
    told_ = true;
    kg_ = said_kg;
    return kg_;
  }

 private:
  double kg_ = signals::unmeasured;
  bool told_ = false;
};

}  // namespace joulecast::telemetry
