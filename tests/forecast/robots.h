#pragma once

#include <string>
#include <string_view>

#include "client/virtual_robot/fleet.h"
#include "dynamics/drive_model.h"
#include "robot/robot_file.h"

namespace joulecast::forecast {

inline robot::RobotModel shipped(std::string_view kind) {
  for (const auto& robot : virtual_robot::shipped_robots())
    if (robot.kind == kind) return *robot::parse_robot(robot.json_text);
  return {};
}

}  // namespace joulecast::forecast
