#include "gap/verdict_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "gap/chart.h"

namespace joulecast::gap {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Diagnosis with_effect(Verdict verdict) {
  Diagnosis d;
  d.verdict = verdict;
  d.power_absolute_relative = 0.2;
  d.noise_floor = 0.01;
  d.effects.emplace_back();
  d.effects[0].id = "coulomb_friction";
  d.effects[0].probability = 0.4;
  d.shrinkage = Shrinkage{.before = 0.2, .after = 0.015, .fraction = 0.9, .interval = {0.85, 0.95}};
  return d;
}

TEST(VerdictText, SureVerdictsNeedNoReasons) {
  EXPECT_THAT(verdict_reasons(with_effect(Verdict::effects)), IsEmpty());
  EXPECT_THAT(verdict_reasons(with_effect(Verdict::none)), IsEmpty());
}

TEST(VerdictText, TellsWhereSomethingUnknownShowsAndWhatItFollows) {
  Diagnosis d = with_effect(Verdict::outside);
  d.outside = {.probability = 1, .channel = "wheel_torque", .follows = "wheel_angle"};
  EXPECT_THAT(verdict_reasons(d),
              ElementsAre(HasSubstr("the torque at the wheels and repeats with the turning of a wheel")));
  d.outside.follows = "yaw_rate";
  EXPECT_THAT(verdict_reasons(d),
              ElementsAre("It shows in the torque at the wheels and follows the yaw rate."));
}

TEST(VerdictText, TellsWhatRemembersTheMotion) {
  Diagnosis d = with_effect(Verdict::outside);
  d.outside = {.probability = 1, .channel = "battery_power_from_motors", .follows = "recent_motion"};
  EXPECT_THAT(verdict_reasons(d), ElementsAre(HasSubstr("how much the robot moved of late")));
}

TEST(VerdictText, SaysThatHelpIsNotSure) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  d.shrinkage->interval = {-0.1, 0.22};
  EXPECT_THAT(verdict_reasons(d), ElementsAre(HasSubstr("is not sure: the gap shrinks by")));
}

TEST(VerdictText, NamesWhatSpeaksAgainstTheLikeliest) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  EXPECT_THAT(verdict_reasons(d), ElementsAre(HasSubstr("Coulomb friction has a probability of 0.40 only")));
  d.effects[0].alternatives = {"viscous_friction", "gear_efficiency"};
  d.outside.probability = 0.35;
  EXPECT_THAT(
      verdict_reasons(d),
      ElementsAre("These data do not tell coulomb friction from viscous friction and gear efficiency.",
                  HasSubstr("may be at work as well (probability 0.35)")));
  d.effects[0].alternatives.clear();
  d.outside.probability = 0;
  d.shrinkage->after = 0.1;
  EXPECT_THAT(verdict_reasons(d),
              ElementsAre(HasSubstr("10 % of the power is still missed on missions left out")));
  d.shrinkage->after = 0.3;
  d.shrinkage->interval = {-0.7, -0.3};
  EXPECT_THAT(verdict_reasons(d), ElementsAre(HasSubstr("it makes the gap larger, 30 % instead of 20 %")));
}

TEST(VerdictText, SaysWhatStandsOrIsMissingWhereNothingIsNamed) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  d.effects.clear();
  EXPECT_THAT(verdict_reasons(d),
              ElementsAre(HasSubstr("20 % of the power is missed where noise makes 1 %")));
  d.power_absolute_relative = std::nan("");
  EXPECT_THAT(verdict_reasons(d), ElementsAre(HasSubstr("too little to judge by")));
  d.power = PowerSource::none;
  EXPECT_THAT(verdict_reasons(d), ElementsAre(HasSubstr("No power was recorded")));
}

TEST(VerdictText, RangesAreAsFineAsTheyAreWide) {
  EXPECT_EQ(brief_range(-0.504322, 0.014813), "−0.50 to 0.01");
  EXPECT_EQ(brief_range(-0.000251, 0.189), "0.00 to 0.19");
  EXPECT_EQ(brief_range(30, 45), "30 to 45");
}

}  // namespace
}  // namespace joulecast::gap
