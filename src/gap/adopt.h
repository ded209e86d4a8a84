#pragma once

#include <span>

#include "base/error.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// The robot file with effects that a diagnosis found beyond those it has. Where it has one of them already,
// the strengths add up, and shapes (a zone's place, a time constant) become means weighted by strength.
// Fault::invalid names the effect and parameter where the sum leaves the catalogue's bounds.
Result<robot::RobotModel> with_effects(robot::RobotModel robot, std::span<const robot::AdoptedEffect> found);

}  // namespace joulecast::gap
