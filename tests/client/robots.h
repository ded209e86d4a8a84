#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "client/virtual_robot/fleet.h"

namespace joulecast::virtual_robot {

// A shipped robot; the test ends here when its file does not parse.
inline RobotParameters shipped(std::string_view kind) {
  for (const auto& robot : shipped_robots()) {
    if (robot.kind != kind) continue;
    auto parsed = parse_robot(std::string(robot.json_text));
    EXPECT_TRUE(parsed) << describe(parsed.error());
    return *parsed;
  }
  ADD_FAILURE() << "no shipped robot is called " << kind;
  return {};
}

}  // namespace joulecast::virtual_robot
