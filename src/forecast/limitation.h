#pragma once

#include <optional>
#include <string>

#include "forecast/leg_cost.h"

namespace joulecast::forecast {

// A pace that a robot's motors do not reach with a payload, within its current limit and its battery's
// nominal voltage.
struct Limitation {
  bool moves = true;  // slower, at `reached`; else not at all
  Pace reached;
  std::string sentence;
};

// Straight ahead and turning in place; empty where the pace is reached.
std::optional<Limitation> limitation(const LegPricer& pricer, const robot::RobotModel& robot,
                                     const Pace& wanted, double payload_kg);

}  // namespace joulecast::forecast
