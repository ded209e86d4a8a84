#pragma once

#include <string>

#include "robot/robot_model.h"

namespace joulecast::robot {

// The same text for robots of one kind: the parameters of their design, which no calibration changes.
std::string kind_of(const RobotModel& robot);

}  // namespace joulecast::robot
