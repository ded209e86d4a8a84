#include "gap/verdict/adopt.h"

#include <gtest/gtest.h>

#include <array>

#include "dynamics/catalogue.h"
#include "gap/traits.h"
#include "robot/robot_fields.h"
#include "robot/robot_file.h"

namespace joulecast::gap {
namespace {

TEST(Adopt, SumsRepeatedEffects) {
  const auto robot = robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/nomad.json");
  ASSERT_TRUE(robot);
  const robot::AdoptedEffect friction{"coulomb_friction", {{"strength", 0.2}}};
  const std::string name(dynamics::find_effect("coulomb_friction")->info().parameters[0].name);
  robot::AdoptedEffect first = friction;
  first.parameters[0].first = name;
  const auto once = with_effects(*robot, {&first, 1});
  ASSERT_TRUE(once) << describe(once.error());
  const auto twice = with_effects(*once, {&first, 1});
  ASSERT_TRUE(twice) << describe(twice.error());
  ASSERT_EQ(twice->effects.size(), 1U);
  EXPECT_DOUBLE_EQ(twice->effects[0].parameters[0].second, 0.4);
  first.parameters[0].second = dynamics::find_effect("coulomb_friction")->info().parameters[0].maximum;
  EXPECT_EQ(with_effects(*once, {&first, 1}).error().fault, Fault::invalid);
}

TEST(Adopt, KeepsRobotKindOnCorrection) {
  const auto robot = robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/nomad.json");
  ASSERT_TRUE(robot);
  std::size_t corrected = 0;
  for (const Traits& traits : traits_table) {
    if (traits.calibrates.empty()) continue;
    const std::string name(dynamics::find_effect(traits.id)->info().parameters[0].name);
    const robot::AdoptedEffect found{std::string(traits.id), {{name, 0.01}}};
    const auto after = with_corrections(*robot, {&found, 1});
    ASSERT_TRUE(after) << traits.id << ": " << describe(after.error());
    EXPECT_NE(*after, *robot) << traits.id;
    EXPECT_EQ(robot::kind_of(*after), robot::kind_of(*robot)) << traits.id;
    ++corrected;
  }
  EXPECT_GE(corrected, 5u);
}

// A base load is not negative: what supplies more than it is an effect of the corrected file.
TEST(Adopt, KeepsSupplyAsEffect) {
  const auto robot = robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/nomad.json");
  ASSERT_TRUE(robot);
  const double supply_w = robot->idle_power_w + 10;
  const robot::AdoptedEffect found{"accessory_load", {{"power_w", -supply_w}}};
  const auto after = with_corrections(*robot, {&found, 1});
  ASSERT_TRUE(after) << describe(after.error());
  EXPECT_EQ(after->idle_power_w, robot->idle_power_w);
  ASSERT_EQ(after->effects.size(), robot->effects.size() + 1);
  EXPECT_EQ(after->effects.back().parameters[0].second, -supply_w);
  const auto corrections = corrections_of(*robot, {&found, 1}, std::array{0.5});
  ASSERT_EQ(corrections.size(), 1u);
  EXPECT_EQ(corrections[0].parameter, "effects.accessory_load.power_w");
  EXPECT_EQ(corrections[0].fits, -supply_w);
}

TEST(Adopt, CorrectsStrengthWithValue) {
  const auto robot = robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/nomad.json");
  ASSERT_TRUE(robot);
  const robot::AdoptedEffect found{"payload_mass_error", {{"ratio", 0}, {"extra_kg", 12}}};
  const auto corrections = corrections_of(*robot, {&found, 1}, std::array{2.0});
  ASSERT_EQ(corrections.size(), 1u);
  EXPECT_EQ(corrections[0].parameter, "effects.payload_mass_error.extra_kg");
  EXPECT_EQ(corrections[0].fits, 12);
}

}  // namespace
}  // namespace joulecast::gap
