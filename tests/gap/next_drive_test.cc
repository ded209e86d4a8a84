#include "gap/verdict/next_drive.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "gap/diagnose/recordings.h"
#include "gap/posterior/functions.h"
#include "gap/verdict/diagnosis_json.h"
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

// A load and a bias of the current sensor, which long driving should have distinguished.
TEST(NextDrive, OffersNoDriveThatWasDriven) {
  const made::Robot robot = made::virtual_robot("amr", 41, [](made::vr::SimulationSpec& spec) {
    spec.script.duration_s = 300;
    spec.missions = 4;
    spec.imperfections = *made::vr::make_imperfections({{"accessory_load", 6}});
  });
  const auto d = diagnose(robot.recordings, robot.model);
  ASSERT_TRUE(d);
  ASSERT_EQ(d->effects.size(), 1u);
  EXPECT_EQ(d->effects[0].alternatives, std::vector<std::string>{"current_sensor_bias"});
  EXPECT_TRUE(d->next_drive.empty());
  EXPECT_EQ(diagnosis_to_json(*d)["effects"][0]["workshop"],
            "what else draws power: computer, lights, heater, charger; zero of the current sensors with all "
            "off");
}

}  // namespace
}  // namespace joulecast::gap
