#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "gap/verdict/text.h"
#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Outside outside_of(std::string channel, std::string follows) {
  Outside outside;
  outside.probability = 1;
  outside.channel = std::move(channel);
  outside.follows = std::move(follows);
  return outside;
}

// Held-out errors of the linear regression, the unchanged model and the explanation.
Baseline baseline(double regression, double model, double explanation) {
  Baseline b;
  b.held_out = regression;
  b.unchanged_model_held_out = model;
  b.explanation_held_out = explanation;
  return b;
}

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

std::vector<std::string> said_of(const Diagnosis& d) {
  return reasons_for(d, false);
}

TEST(VerdictText, OmitsReasonsOfSureVerdicts) {
  EXPECT_THAT(said_of(with_effect(Verdict::effects)), IsEmpty());
  EXPECT_THAT(said_of(with_effect(Verdict::none)), IsEmpty());
}

TEST(VerdictText, NamesTermBesideNoGap) {
  Diagnosis d = with_effect(Verdict::none);
  d.baseline = baseline(0.02, 0.01, 0.01);
  d.baseline->terms = {{"v^2", "W per (m/s)^2", 1.31, 0.55, 1.58}, {"v a", "kg", 16.681, 0.067, 14.665}};
  EXPECT_THAT(said_of(d), ElementsAre("No gap that matters, although the term v a of power is 16.681 ± 0.067 "
                                      "kg in the data and 14.7 in the robot file."));
  d.baseline->terms[1].value = 14.9;
  EXPECT_THAT(said_of(d), IsEmpty());
}

TEST(VerdictText, NamesChannelAndVariableOutside) {
  Diagnosis d = with_effect(Verdict::outside);
  d.outside = outside_of("wheel_torque", "wheel_angle");
  EXPECT_THAT(said_of(d),
              ElementsAre(HasSubstr("the torque at the wheels and repeats with the turning of a wheel")));
  d.outside.follows = "yaw_rate";
  EXPECT_THAT(
      said_of(d),
      ElementsAre("An unknown cause (probability > 97\u00a0%) shows in the torque at the wheels and follows "
                  "the yaw rate."));
}

TEST(VerdictText, AddsUnknownCauseToEffects) {
  Diagnosis d = with_effect(Verdict::effects);
  d.outside = outside_of("wheel_torque", "acceleration");
  EXPECT_THAT(
      said_of(d),
      ElementsAre("In addition to the effects found, an unknown cause (probability > 97\u00a0%) shows in "
                  "the torque at the wheels and follows the acceleration."));
}

TEST(VerdictText, ReportsDependenceOnRecentMotion) {
  Diagnosis d = with_effect(Verdict::outside);
  d.outside = outside_of("battery_power_from_motors", "recent_motion");
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("recent motion of the robot")));
}

TEST(VerdictText, ReportsUncertainShrinkage) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  d.shrinkage->interval = {-0.1, 0.22};
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("is uncertain: the gap shrinks by")));
}

TEST(VerdictText, NamesContradictingEvidence) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("The probability of coulomb friction is only 40\u00a0%")));
  d.effects[0].alternatives = {"viscous_friction", "gear_efficiency"};
  d.outside.probability = 0.35;
  EXPECT_THAT(
      said_of(d),
      ElementsAre("These data do not distinguish coulomb friction from viscous friction or gear efficiency.",
                  HasSubstr("cause outside the catalogue may be present, too (probability 35\u00a0%)")));
  d.effects[0].alternatives.clear();
  d.outside.probability = 0;
  d.shrinkage->after = 0.1;
  EXPECT_THAT(said_of(d),
              ElementsAre(HasSubstr("an error of 10\u00a0% of the power remains on held-out data; "
                                    "the noise floor is 1\u00a0%")));
  d.shrinkage->after = 0.3;
  d.shrinkage->interval = {-0.7, -0.3};
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("effect increases the gap by 30\u00a0% to 70\u00a0%")));
}

TEST(VerdictText, ReportsReasonsWithoutEffects) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  d.effects.clear();
  EXPECT_THAT(said_of(d),
              ElementsAre(HasSubstr("error is 20\u00a0% of the power at a noise floor of 1\u00a0%")));
  d.power_absolute_relative = 0.015;
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("may be noise or a hidden cause")));
  d.power_absolute_relative = std::nan("");
  d.power = PowerSource::none;
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("the torques of the motors alone")));
  d.motor_channels = false;
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("the voltages of the motors alone")));
}

TEST(VerdictText, StatesMissingData) {
  Diagnosis d;
  EXPECT_THAT(missing_data(d, false), HasSubstr("less usable motion"));
  EXPECT_THAT(missing_data(d, true), HasSubstr("too few seconds of motion with power"));
  d.power = PowerSource::none;
  EXPECT_THAT(missing_data(d, true), HasSubstr("needs battery_voltage with battery_current"));
  d.checks = {{"impossible_readings", "battery_voltage", 601, {}, "", false},
              {"wheel_velocity_scale", "wheel_velocity", 2, {}, "", true}};
  EXPECT_THAT(missing_data(d, true), HasSubstr("without the readings of battery_voltage, which"));
}

TEST(VerdictText, NamesBetterBaseline) {
  Diagnosis d = with_effect(Verdict::inconclusive);
  d.baseline = baseline(0.1, 0.2, 0.15);
  d.baseline->says = {"Drag."};
  EXPECT_THAT(reasons_for(d, true),
              ElementsAre(AllOf(HasSubstr("linear regression"), HasSubstr("acceleration is 10\u00a0%"),
                                HasSubstr("explanation 15\u00a0%")),
                          "Drag."));
  d.baseline->unchanged_model_held_out = 0.05;
  EXPECT_THAT(reasons_for(d, true), ElementsAre(HasSubstr("the error is 5\u00a0% with the robot file")));
}

TEST(VerdictText, ReportsVaryingStrengths) {
  Diagnosis d = with_effect(Verdict::effects);
  d.effects[0].varies = 0.6;
  EXPECT_THAT(said_of(d), ElementsAre(HasSubstr("varies by 60\u00a0% of its mean")));
  d.effects[0].varies = 0.1;
  EXPECT_THAT(said_of(d), IsEmpty());
}

TEST(VerdictText, RoundsRangesByWidth) {
  EXPECT_EQ(brief_range(-0.504322, 0.014813), "−0.50 to 0.01");
  EXPECT_EQ(brief_range(-0.000251, 0.189), "0.00 to 0.19");
  EXPECT_EQ(brief_range(30, 45), "30 to 45");
}

}  // namespace
}  // namespace joulecast::gap
