#include "tests/gap/checks/mistakes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>

#include "gap/checks/check.h"
#include "tests/gap/checks/made_recordings.h"

namespace joulecast::gap {
namespace {

namespace vr = virtual_robot;

// A carrier with every channel.
const made::Robot& carrier() {
  static const made::Robot robot = made::virtual_robot("amr", 21);
  return robot;
}

std::string told(const std::vector<Check>& checks) {
  std::string text;
  for (const Check& c : checks) text += (c.contradicted ? "X " : "  ") + c.id + ": " + c.says + "\n";
  return text;
}

class Mistakes : public testing::TestWithParam<mistakes::Mistake> {};

TEST_P(Mistakes, AreFoundAndNothingElseIsBlamed) {
  const mistakes::Mistake& mistake = GetParam();
  telemetry::RecordingSet set = carrier().recordings;
  mistake.make(set, carrier().model);
  const auto checks = check_recordings(set, carrier().model);
  const auto found = std::ranges::find_if(checks, [&](const Check& c) {
    return c.id == mistake.id && c.channel.find(mistake.channel) != std::string::npos;
  });
  ASSERT_NE(found, checks.end()) << told(checks);
  EXPECT_EQ(found->contradicted, mistake.contradicts);
  EXPECT_GT(found->says.size(), 40u);
  EXPECT_EQ(std::ranges::count_if(checks, &Check::contradicted), mistake.contradicts ? 1 : 0) << told(checks);
  EXPECT_LE(checks.size(), 12u);
}

INSTANTIATE_TEST_SUITE_P(All, Mistakes, testing::ValuesIn(mistakes::all_mistakes()), [](const auto& mistake) {
  std::string name = mistake.param.name;
  std::erase_if(name, [](unsigned char c) { return std::isalnum(c) == 0 && c != ' '; });
  std::ranges::replace(name, ' ', '_');
  return name;
});

TEST(SoundRobots, AreNotContradicted) {
  struct Case {
    const char* kind;
    std::uint64_t seed;
    std::vector<vr::EffectStrength> effects;
  };
  for (const Case& c :
       {Case{"amr", 21, {}}, Case{"nomad", 22, {}}, Case{"p3dx", 23, {}}, Case{"tug", 24, {}},
        Case{"amr", 25, {{"coulomb_friction", 1.5}}}, Case{"tug", 26, {{"current_sensor_gain", 0.2}}},
        Case{"nomad", 27, {{"turning_scrub", 0.5}}}, Case{"p3dx", 28, {{"torque_constant_loss", 0.3}}},
        Case{"amr", 29, {{"slope", 0.05}}}, Case{"tug", 30, {{"track_error", 0.3}}}}) {
    for (const bool motors : {true, false}) {
      const made::Robot robot = made::virtual_robot(c.kind, c.seed, [&](vr::SimulationSpec& spec) {
        spec.sensors.motor_channels = motors;
        spec.imperfections = *vr::make_imperfections(c.effects);
      });
      const auto checks = check_recordings(robot.recordings, robot.model);
      EXPECT_TRUE(std::ranges::none_of(checks, &Check::contradicted)) << c.kind << c.seed << told(checks);
      EXPECT_LE(checks.size(), c.effects.empty() ? 0u : 2u) << c.kind << c.seed << told(checks);
    }
  }
}

}  // namespace
}  // namespace joulecast::gap
