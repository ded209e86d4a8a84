#include "robot/robot_file.h"
#include "text_input.h"

using namespace joulecast;

// A parsed file round-trips.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto robot = robot::parse_robot(testing::as_text(data, size));
  if (!robot) return 0;
  const std::string text = robot::to_json_text(*robot);
  const auto again = robot::parse_robot(text);
  testing::require(again && robot::to_json_text(*again) == text);
  return 0;
}
