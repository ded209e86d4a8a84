#pragma once

#include <cmath>

#include "signals/sample.h"

namespace joulecast::telemetry {

// The payload that a mission's samples are accounted with, kg, in their order: what the sample says; where it
// says nothing (NaN), what an earlier one of the mission said, else what the mission's start declared.
//
// A robot that leaves its field at 0 and declares a load at the start contradicts itself: such a 0 counts as
// nothing said, until a sample of the mission has named a load. From then on 0 means that it was set down.
class MissionPayload {
 public:
  MissionPayload() = default;
  // `declared_kg` at the mission's start, NaN: nothing. `told`: earlier samples have named a load or were
  // right to say 0.
  explicit MissionPayload(double declared_kg, bool told = false) : kg_(declared_kg), told_(told) {}

  // Whether the sample's 0 contradicts the mission's start.
  bool contradicts(double said_kg) const { return said_kg == 0 && !told_ && kg_ > 0; }

  // NaN: neither the sample nor any before it nor the start has said anything.
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
