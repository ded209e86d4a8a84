#pragma once

#include <string>

#include "robot/robot_model.h"

namespace joulecast::robot {

// Robots that share this text are of one kind: what their makers built in, of which no calibration,
// refinement or diagnosis changes anything.
std::string kind_of(const RobotModel& robot);

}  // namespace joulecast::robot
