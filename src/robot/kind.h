#pragma once

#include <string>

#include "robot/robot_model.h"

namespace joulecast::robot {

// Robots with the same text are of one kind: the parameters of their design, which no calibration, refinement
// or diagnosis changes.
std::string kind_of(const RobotModel& robot);

}  // namespace joulecast::robot
