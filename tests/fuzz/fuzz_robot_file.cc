#include "fuzz.h"
#include "robot/robot_file.h"

using namespace joulecast;

// A parsed file round-trips.
JOULECAST_FUZZ_TARGET(robot_file) {
  const auto robot = robot::parse_robot(testing::as_text(data, size));
  if (!robot) return;
  const std::string text = robot::to_json_text(*robot);
  const auto again = robot::parse_robot(text);
  testing::require(again && robot::to_json_text(*again) == text);
}
