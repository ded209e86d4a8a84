#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "gap/verdict/adopt.h"
#include "gap/verdict/answer.h"
#include "gap/verdict/diagnosis_json.h"
#include "gap/verdict/text.h"
#include "robot/robot_file.h"
#include "tests/gap/verdict/made_diagnosis.h"
#include "tests/support/sample_robots.h"

namespace joulecast::gap {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::made_diagnosis;

const std::vector<std::string> friction{"coulomb_friction ratio 0.41"},
    viscous{"viscous_friction ratio 3.00"};

// Coulomb friction that the data do not distinguish from viscous friction.
Diagnosis undecided() {
  Diagnosis d = made_diagnosis();
  d.effects[0].alternatives = {"viscous_friction", "turning_scrub"};
  d.effects[0].instead = {{"viscous_friction", {{"ratio", 3.0}}}};
  return d;
}

// Effects of a robot file with their first parameters.
std::vector<std::string> effects_of(const robot::RobotModel& model) {
  std::vector<std::string> texts;
  for (const robot::AdoptedEffect& e : model.effects)
    texts.push_back(
        fmt::format("{} {} {:.2f}", e.id, e.parameters.front().first, e.parameters.front().second));
  return texts;
}

std::vector<std::string> taken(const Offer& offer, const Choice& choice) {
  const auto model = take(offer, joulecast::testing::nomad(), choice);
  if (!model) ADD_FAILURE() << describe(model.error());
  return model ? effects_of(*model) : std::vector<std::string>{};
}

std::vector<std::string> taken(const Diagnosis& d, const Choice& choice) {
  return taken(offer_of(d), choice);
}

Error refused(const Offer& offer, const Choice& choice = {}) {
  const auto model = take(offer, joulecast::testing::nomad(), choice);
  EXPECT_FALSE(model);
  return model ? Error{} : model.error();
}

Error refused(const Diagnosis& d, const Choice& choice = {}) {
  return refused(offer_of(d), choice);
}

TEST(Offer, AcceptsUncontestedOffer) {
  EXPECT_EQ(taken(made_diagnosis(), {}), friction);
}

TEST(Offer, RejectsEmptyOfferDespiteForce) {
  Diagnosis d = made_diagnosis();
  d.adoptable.clear();
  d.refusal = "no change of the robot file was found";
  const Error error = refused(d, {{}, true});
  EXPECT_EQ(error.fault, Fault::conflict);
  EXPECT_EQ(error.message, d.refusal);
  EXPECT_FALSE(error.message.empty());
}

TEST(Offer, RequiresForceAfterRefusal) {
  for (const Verdict verdict : {Verdict::outside, Verdict::inconclusive}) {
    Diagnosis d = made_diagnosis();
    d.verdict = verdict;
    d.refusal = "the held-out error falls by 0.3 % of power, less than 1 %";
    EXPECT_EQ(refused(d).message, d.refusal);
    EXPECT_EQ(refused(d, {{"coulomb_friction"}, false}).message, d.refusal);
    EXPECT_EQ(taken(d, {{}, true}), friction);
  }
}

TEST(Offer, AcceptsEquivalentsWithoutChoice) {
  const Diagnosis d = undecided();
  EXPECT_EQ(taken(d, {}), friction);
  EXPECT_EQ(taken(d, {{"viscous_friction"}, false}), viscous);
}

TEST(Offer, RejectsChoiceWithoutStrength) {
  const Offer d = offer_of(undecided());
  EXPECT_THAT(refused(d, {{"turning_scrub"}, false}).message, HasSubstr("no strength of turning_scrub"));
  Error error = refused(d, {{"brush_drop"}, false});
  EXPECT_EQ(error.fault, Fault::invalid);
  EXPECT_EQ(error.field, "effect");
  EXPECT_THAT(error.message, HasSubstr("brush_drop is not among"));
  error = refused(d, {{"viscous_friction", "coulomb_friction"}, false});
  EXPECT_EQ(error.fault, Fault::invalid);
}

TEST(Offer, CorrectsMismatchedRobotFile) {
  Diagnosis d = made_diagnosis();
  d.verdict = Verdict::not_this_robot;
  const robot::RobotModel before = joulecast::testing::nomad();
  const auto after = take(offer_of(d), before);
  ASSERT_TRUE(after) << describe(after.error());
  EXPECT_TRUE(after->effects.empty());
  EXPECT_NEAR(after->motor.friction_torque_nm[0], 1.41 * before.motor.friction_torque_nm[0], 1e-9);
}

TEST(Offer, SurvivesJsonRoundTrip) {
  for (const Diagnosis& d : {made_diagnosis(), undecided()}) {
    const Offer offer = offer_of(d);
    const auto again = offer_from_json(json::parse(diagnosis_to_json(d).dump()));
    ASSERT_TRUE(again) << describe(again.error());
    EXPECT_EQ(offer_table().text(*again), offer_table().text(offer));
  }
}

TEST(Offer, RejectsDiagnosisWithoutOffer) {
  json old = json::parse(diagnosis_to_json(made_diagnosis()).dump());
  old.erase("adoption");
  EXPECT_EQ(offer_from_json(old).error().fault, Fault::corrupt);
  EXPECT_EQ(offer_from_json(json::object()).error().fault, Fault::corrupt);
}

// An error of the wheels with a probability of 0.3 is left in the readings, one of the current with 0.9 is
// corrected.
TEST(Offer, WeighsCausesByChecks) {
  Diagnosis d = made_diagnosis();
  const double before = d.effects[0].probability, group = d.effects[0].group;
  d.checks.push_back({"wheel_velocity_scale", "wheel_velocity", 2, {1.9, 2.1}, "It may be twice.", false});
  d.checks.back().error = 0.3;
  d.checks.push_back({"battery_current_scale", "battery_current", 10, {9, 11}, "It is ten times.", false});
  d.checks.back().probability = 0.9;
  d.checks.back().factor = 10;
  weigh_by_checks(d);
  EXPECT_NEAR(d.effects[0].probability, 0.7 * 0.9 * before, 1e-12);
  EXPECT_NEAR(d.effects[0].group, 0.7 * 0.9 * group, 1e-12);
  EXPECT_EQ(d.verdict, Verdict::effects);
  EXPECT_EQ(d.refusal, made_diagnosis().refusal);
  // A channel that is not used does not matter.
  d.checks.back().contradicted = true;
  weigh_by_checks(d);
  EXPECT_NEAR(d.effects[0].probability, 0.7 * 0.7 * 0.9 * before, 1e-12);
}

TEST(Offer, RefusesCausesOfLikelyError) {
  Diagnosis d = made_diagnosis();
  d.checks.push_back({"wheel_velocity_scale", "wheel_velocity", 2, {1.9, 2.1}, "It may be twice.", false});
  d.checks.back().error = 0.6;
  weigh_by_checks(d);
  EXPECT_EQ(d.verdict, Verdict::inconclusive);
  EXPECT_THAT(reasons_for(d, false).front(), HasSubstr("60\u00a0%"));
  EXPECT_THAT(offer_of(d).refusal, HasSubstr("60\u00a0%"));
}

}  // namespace
}  // namespace joulecast::gap
