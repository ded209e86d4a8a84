#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "missions.h"

namespace joulecast::forecast {

// Robots of one kind, of a plant that shares no equation with the product. Their departures from the robot
// file, pace and halts differ a little from robot to robot; ramps, cruises and halts vary from leg to leg,
// and payloads and friction from mission to mission. Robots of an inexact kind stop some millimetres early
// and have cruises and ramps other than their plan's. Velocity commands are those of the plan.
std::vector<RobotRun> run_foreign_kind(std::uint64_t seed, bool exact, std::size_t robots,
                                       std::size_t missions);

}  // namespace joulecast::forecast
