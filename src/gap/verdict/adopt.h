#pragma once

#include <span>
#include <vector>

#include "base/error.h"
#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// Returns the robot file with the effects of a diagnosis added. Where the file has one of them already,
// strengths add up, and shapes (a zone's place, a time constant) become means weighted by strength.
// Fault::invalid names the effect and parameter where the sum leaves the catalogue's bounds.
Result<robot::RobotModel> with_effects(robot::RobotModel robot, std::span<const robot::AdoptedEffect> found);

// The same for a mismatched file: effects that correct a parameter of the file (Traits::calibrates) change
// that parameter; the others are adopted.
Result<robot::RobotModel> with_corrections(robot::RobotModel robot,
                                           std::span<const robot::AdoptedEffect> found);

// The changes by with_corrections() to the robot file, with the deviations of the strengths, one each.
std::vector<FileCorrection> corrections_of(const robot::RobotModel& robot,
                                           std::span<const robot::AdoptedEffect> found,
                                           std::span<const double> deviations);

}  // namespace joulecast::gap
