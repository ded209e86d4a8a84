#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "gap/diagnose/recordings.h"
#include "robot/robot_file.h"
#include "telemetry/recording_set.h"
#include "tests/support/shared_folder.h"

namespace joulecast::gap {
namespace {

std::string answer_of(const Diagnosis& d) {
  std::ostringstream text;
  text << name_of(d.verdict) << ", gap " << d.power_absolute_relative << " over noise " << d.noise_floor;
  for (const DiagnosedEffect& e : d.effects) {
    text << "; " << e.id;
    for (const DiagnosedParameter& p : e.parameters)
      text << " " << p.name << " " << p.value << " +- " << p.deviation;
    text << ", probability " << e.probability << " (" << e.posterior << " by the data), " << e.power_w
         << " W";
  }
  return text.str();
}

// The practice logs: another plant's recordings with their truths.
class Practice : public testing::TestWithParam<const char*> {};

TEST_P(Practice, GetsTheRightVerdict) {
  const std::filesystem::path folder = std::filesystem::path(JOULECAST_SHARED) / "data/practice" / GetParam();
  JOULECAST_NEED_SHARED(std::filesystem::exists(folder), "practice log " << folder);
  const auto robot = robot::load_robot(folder / "robot.json");
  ASSERT_TRUE(robot);
  const std::string log = folder / "telemetry.lcmlog";
  const auto recordings = telemetry::load_recordings({&log, 1});
  ASSERT_TRUE(recordings);
  DiagnosisSettings settings;
  settings.controls = 0;
  const auto diagnosis = diagnose(*recordings, *robot, settings);
  ASSERT_TRUE(diagnosis);
  SCOPED_TRACE(answer_of(*diagnosis));

  std::ifstream in(folder / "truth.json");
  const auto truth = nlohmann::json::parse(in);
  std::map<std::string, double> strengths = truth["effects"];
  EXPECT_EQ(diagnosis->motor_channels, truth["motor_channels"].get<bool>());
  if (strengths.empty()) {
    EXPECT_EQ(name_of(diagnosis->verdict), "none");
    return;
  }
  if (strengths.begin()->first.starts_with("x_")) {
    EXPECT_EQ(name_of(diagnosis->verdict), "outside");
    return;
  }
  EXPECT_EQ(name_of(diagnosis->verdict), "effects");
  ASSERT_EQ(diagnosis->effects.size(), strengths.size());
  for (const DiagnosedEffect& effect : diagnosis->effects) {
    const auto planted = strengths.find(effect.id);
    ASSERT_NE(planted, strengths.end()) << effect.id << " is not there, or named twice";
    EXPECT_NEAR(effect.parameters.front().value, planted->second, 0.1 * planted->second) << effect.id;
    // A constant load and the offset of a current sensor differ by nothing that was recorded.
    const bool constant_load = effect.id == "accessory_load";
    EXPECT_EQ(effect.alternatives,
              constant_load ? std::vector<std::string>{"current_sensor_bias"} : std::vector<std::string>{});
    strengths.erase(planted);
  }
  // The effects take away most of what noise and sampling do not make.
  ASSERT_TRUE(diagnosis->shrinkage);
  EXPECT_GT(diagnosis->shrinkage->interval[0], 0.5);
}

INSTANTIATE_TEST_SUITE_P(Logs, Practice,
                         testing::Values("01_load_rolling", "02_scrub", "03_no_regeneration", "04_accessory",
                                         "05_zone", "06_two", "07_none", "08_outside"),
                         [](const auto& log) { return std::string(log.param).substr(3); });

}  // namespace
}  // namespace joulecast::gap
