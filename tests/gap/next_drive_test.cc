#include "gap/verdict/next_drive.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "gap/posterior/functions.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap {
namespace {

Outside following(const std::string& variable) {
  Outside outside;
  outside.probability = 1;
  outside.follows = variable;
  return outside;
}

TEST(NextDrive, ReturnsDriveForEveryVariable) {
  std::set<std::string> variables{"wheel_angle"};
  for (const bool motors : {false, true}) {
    const made::Robot robot = made::virtual_robot(
        "nomad", 41, [&](made::vr::SimulationSpec& spec) { spec.sensors.motor_channels = motors; });
    const auto data = posterior::make_data(robot.recordings.missions, robot.model);
    ASSERT_TRUE(data);
    for (const posterior::Function& function : posterior::make_functions(*data))
      variables.insert(function.variable);
  }
  EXPECT_GT(variables.size(), 5u);
  for (const std::string& variable : variables)
    EXPECT_EQ(drives_for(following(variable)).size(), 1u) << variable;
  EXPECT_TRUE(drives_for({}).empty());
}

}  // namespace
}  // namespace joulecast::gap
