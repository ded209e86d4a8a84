#pragma once

#include <span>
#include <vector>

#include "base/error.h"
#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// The robot file with effects that a diagnosis found beyond those it has. Where it has one of them already,
// strengths add up, and shapes (a zone's place, a time constant) become means weighted by strength.
// Fault::invalid names the effect and parameter where the sum leaves the catalogue's bounds.
Result<robot::RobotModel> with_effects(robot::RobotModel robot, std::span<const robot::AdoptedEffect> found);

// The same for a file that is not this robot's: effects that only say that a parameter of the file is another
// one (Traits::calibrates) correct it; the others are adopted.
Result<robot::RobotModel> with_corrections(robot::RobotModel robot,
                                           std::span<const robot::AdoptedEffect> found);

// What with_corrections() changes in the robot file, with the deviations of the strengths, one each.
std::vector<FileCorrection> corrections_of(const robot::RobotModel& robot,
                                           std::span<const robot::AdoptedEffect> found,
                                           std::span<const double> deviations);

}  // namespace joulecast::gap
