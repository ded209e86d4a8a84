#include "tests/study/trial/trial_case.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "client/virtual_robot/fleet.h"
#include "robot/robot_file.h"
#include "tests/study/trial/robot_draw.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::trial {
namespace {

TEST(DrawRobot, VariesValidRobotFiles) {
  std::set<std::string> kinds, texts;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    virtual_robot::Rng rng(seed);
    const DrawnRobot drawn = draw_robot(rng);
    kinds.insert(drawn.kind);
    texts.insert(drawn.json_text);
    const auto model = robot::parse_robot(drawn.json_text);
    ASSERT_TRUE(model) << describe(model.error());
    for (const double friction : model->motor.friction_torque_nm) EXPECT_GT(friction, 0);
  }
  EXPECT_EQ(kinds.size(), virtual_robot::shipped_robots().size());
  EXPECT_EQ(texts.size(), 60u);
}

TEST(DrawCase, DependsOnSeedAndIndex) {
  TrialSettings few, many;
  few.count = 3;
  many.count = 300;
  const TrialCase a = draw_case(few, 2), b = draw_case(many, 2);
  EXPECT_EQ(a.robot_json, b.robot_json);
  EXPECT_EQ(a.seed, b.seed);
  EXPECT_EQ(virtual_robot::effects_of(a.spec.imperfections), virtual_robot::effects_of(b.spec.imperfections));
  many.seed = 2;
  EXPECT_NE(draw_case(many, 2).robot_json, a.robot_json);
}

TEST(DrawCase, MakesStatedGap) {
  TrialSettings settings;
  settings.only_effect = "accessory_load";
  settings.vary_plant = false;
  for (std::size_t index : {0u, 1u, 2u}) {
    const TrialCase c = draw_case(settings, index);
    EXPECT_EQ(c.kind, Kind::single);
    ASSERT_EQ(virtual_robot::effects_of(c.spec.imperfections).size(), 1u);
    const double gap = virtual_robot::power_gap(c.spec, c.seed).added();
    // Drawn on a few short missions: idle and driving are mixed a little differently on all of them.
    EXPECT_NEAR(c.added_gap, gap, 0.25 * gap);
    EXPECT_EQ(c.strength, strength_of(c.added_gap));
  }
}

TEST(StrengthOf, MatchesYardstickStrengths) {
  EXPECT_EQ(strength_of(0.019), Strength::slight);
  EXPECT_EQ(strength_of(0.02), Strength::weak);
  EXPECT_EQ(strength_of(0.05), Strength::medium);
  EXPECT_EQ(strength_of(0.08), Strength::strong);
}

}  // namespace
}  // namespace joulecast::trial
