#pragma once

#include <string>

#include "client/virtual_robot/rng.h"
#include "client/virtual_robot/robot_parameters.h"

namespace joulecast::trial {

struct DrawnRobot {
  std::string kind;  // of the shipped robot that it was varied from
  std::string json_text;
};

// A robot file like those shipped, its masses, sizes, motors, friction and loads varied.
[[nodiscard]] DrawnRobot draw_robot(virtual_robot::Rng& rng);

// The robot as built: within the uncertainty of its file after calibration, 1 to 2 % in friction and
// resistance, less in constants, masses and sizes that are easily measured.
[[nodiscard]] virtual_robot::RobotParameters as_built(virtual_robot::RobotParameters robot,
                                                      virtual_robot::Rng& rng);

}  // namespace joulecast::trial
