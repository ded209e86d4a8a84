#include "tests/study/trial/score.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/study/trial/score_text.h"

namespace joulecast::trial {
namespace {

gap::DiagnosedEffect named(const std::string& id, double value, double deviation, double probability,
                           std::vector<std::string> alternatives = {}) {
  gap::DiagnosedEffect effect;
  effect.id = id;
  effect.probability = probability;
  effect.parameters = {{"ratio", "1", value, deviation}};
  effect.alternatives = std::move(alternatives);
  return effect;
}

CaseOutcome outcome(Kind kind, std::vector<robot::AdoptedEffect> truth, gap::Verdict verdict,
                    std::vector<gap::DiagnosedEffect> effects) {
  CaseOutcome o;
  o.truth.kind = kind;
  o.truth.strength = Strength::strong;
  o.truth.effects = std::move(truth);
  o.diagnosis.verdict = verdict;
  o.diagnosis.verdict_probability = 0.95;
  o.diagnosis.effects = std::move(effects);
  return o;
}

robot::AdoptedEffect truth(const std::string& id, double strength) {
  return {id, {{"strength", strength}}};
}

const robot::AdoptedEffect coulomb = truth("coulomb_friction", 0.5), slope = truth("slope", 0.02);

TEST(Rate, ReturnsWilsonInterval) {
  // Brown, Cai and DasGupta 2001, equation (4), by hand.
  const Rate none{0, 10}, most{8, 10};
  EXPECT_NEAR(none.interval()[0], 0, 1e-12);
  EXPECT_NEAR(none.interval()[1], 0.27753, 1e-5);
  EXPECT_NEAR(most.interval()[0], 0.49016, 1e-5);
  EXPECT_NEAR(most.interval()[1], 0.94332, 1e-5);
  EXPECT_EQ(Rate{}.interval(), (std::array<double, 2>{0, 1}));
}

TEST(ExactlyRight, RequiresExactSetOfEffects) {
  using gap::Verdict;
  const auto found_coulomb = named("coulomb_friction", 0.5, 0.01, 1);
  const auto found_slope = named("slope", 0.02, 0.001, 1);
  EXPECT_TRUE(exactly_right(outcome(Kind::single, {coulomb}, Verdict::effects, {found_coulomb})));
  EXPECT_FALSE(
      exactly_right(outcome(Kind::single, {coulomb}, Verdict::effects, {found_coulomb, found_slope})));
  EXPECT_FALSE(exactly_right(outcome(Kind::single, {coulomb}, Verdict::none, {})));
  EXPECT_FALSE(exactly_right(outcome(Kind::single, {coulomb}, Verdict::inconclusive, {found_coulomb})));
  EXPECT_TRUE(
      exactly_right(outcome(Kind::pair, {coulomb, slope}, Verdict::effects, {found_slope, found_coulomb})));
  EXPECT_FALSE(exactly_right(outcome(Kind::pair, {coulomb, slope}, Verdict::effects, {found_slope})));
  EXPECT_TRUE(exactly_right(outcome(Kind::none, {}, Verdict::none, {})));
  EXPECT_FALSE(exactly_right(outcome(Kind::none, {}, Verdict::outside, {})));
  const auto unknown = truth("x_cogging", 1);
  EXPECT_TRUE(exactly_right(outcome(Kind::outside, {unknown}, Verdict::inconclusive, {})));
  EXPECT_FALSE(exactly_right(outcome(Kind::outside, {unknown}, Verdict::effects, {found_slope})));
}

TEST(ExactlyRight, MatchesGroupsOneToOne) {
  using gap::Verdict;
  const auto group = named("brush_drop", 0.1, 0.1, 0.6, {"coulomb_friction", "slope"});
  EXPECT_TRUE(exactly_right(outcome(Kind::single, {coulomb}, Verdict::effects, {group})));
  const auto wide = named("brush_drop", 0.1, 0.1, 0.6, {"coulomb_friction", "slope", "inductance"});
  EXPECT_FALSE(exactly_right(outcome(Kind::single, {coulomb}, Verdict::effects, {wide})));
  // One group cannot match both.
  const auto other = named("wheel_slip", 0.1, 0.1, 0.6);
  EXPECT_FALSE(exactly_right(outcome(Kind::pair, {coulomb, slope}, Verdict::effects, {group, other})));
  const auto second = named("wheel_slip", 0.1, 0.1, 0.6, {"coulomb_friction"});
  EXPECT_TRUE(exactly_right(outcome(Kind::pair, {coulomb, slope}, Verdict::effects, {group, second})));
}

TEST(FirstRight, UsesFirstNameOnly) {
  using gap::Verdict;
  const auto right = named("coulomb_friction", 0.5, 0.01, 1), wrong = named("slope", 0.02, 0.001, 1);
  EXPECT_TRUE(first_right(outcome(Kind::single, {coulomb}, Verdict::effects, {right, wrong})));
  EXPECT_FALSE(first_right(outcome(Kind::single, {coulomb}, Verdict::effects, {wrong, right})));
  EXPECT_FALSE(first_right(outcome(Kind::single, {coulomb}, Verdict::outside, {right})));
}

TEST(Score, CountsAccurateStrengths) {
  using gap::Verdict;
  std::vector<CaseOutcome> outcomes;
  outcomes.push_back(
      outcome(Kind::single, {coulomb}, Verdict::effects, {named("coulomb_friction", 0.54, 0.01, 0.95)}));
  outcomes.push_back(
      outcome(Kind::single, {coulomb}, Verdict::effects, {named("coulomb_friction", 0.60, 0.06, 0.95)}));
  outcomes.push_back(
      outcome(Kind::single, {coulomb}, Verdict::effects, {named("coulomb_friction", 0.60, 0.01, 0.95)}));
  outcomes.push_back(outcome(Kind::single, {coulomb}, Verdict::effects, {named("slope", 0.02, 0.01, 0.95)}));
  const Score score = score_of(outcomes);
  const StrengthRow& row = score.rows[0][static_cast<std::size_t>(Strength::strong)];
  EXPECT_EQ(row.single_exact.hits, 3u);
  EXPECT_EQ(row.single_exact.tries, 4u);
  EXPECT_EQ(row.strength_within.hits, 1u);
  EXPECT_EQ(row.interval_covers.hits, 1u);
  EXPECT_EQ(row.strength_close.hits, 2u);
  EXPECT_EQ(row.strength_close.tries, 3u);
  EXPECT_EQ(score.effect_reliability[9].right.hits, 3u);
  EXPECT_EQ(score.effect_reliability[9].right.tries, 4u);
  EXPECT_NEAR(score.effect_reliability[9].mean(), 0.95, 1e-12);
  EXPECT_EQ(score.confusion.at("coulomb_friction").at("effects slope"), 1u);
  EXPECT_NE(score_text(score).find("3/4"), std::string::npos);
}

TEST(Score, CountsFalseAlarms) {
  using gap::Verdict;
  std::vector<CaseOutcome> outcomes;
  outcomes.push_back(outcome(Kind::none, {}, Verdict::none, {}));
  outcomes.push_back(outcome(Kind::none, {}, Verdict::outside, {}));
  outcomes.push_back(outcome(Kind::none, {}, Verdict::inconclusive, {}));
  outcomes.push_back(outcome(Kind::none, {}, Verdict::not_this_robot, {}));
  const auto unknown = truth("x_cogging", 1);
  outcomes.push_back(outcome(Kind::outside, {unknown}, Verdict::outside, {named("slope", 0.02, 0.01, 0.95)}));
  outcomes.push_back(outcome(Kind::outside, {unknown}, Verdict::effects, {named("slope", 0.02, 0.01, 0.85)}));
  const Score score = score_of(outcomes);
  EXPECT_EQ(score.none_alarm.hits, 2u);
  EXPECT_EQ(score.not_this_robot.hits, 1u);
  EXPECT_EQ(score.not_this_robot.tries, 6u);
  EXPECT_EQ(score.none_inconclusive.hits, 1u);
  EXPECT_EQ(score.outside_called.hits, 1u);
  EXPECT_EQ(score.outside_misled.hits, 1u);
  EXPECT_EQ(score.outside_misled.tries, 2u);
}

TEST(Score, ComparesShrinkageWithOracle) {
  CaseOutcome good =
      outcome(Kind::single, {coulomb}, gap::Verdict::effects, {named("coulomb_friction", 0.5, 0.01, 1)});
  good.oracle = 0.8;
  good.diagnosis.shrinkage.emplace();
  good.diagnosis.shrinkage->fraction = 0.78;
  CaseOutcome missed = outcome(Kind::single, {coulomb}, gap::Verdict::none, {});
  missed.oracle = 0.8;
  const Score score = score_of(std::vector{good, missed});
  const ShrinkageScore& s = score.rows[0][static_cast<std::size_t>(Strength::strong)].shrinkage;
  EXPECT_EQ(s.reached.hits, 1u);  // 0.975 of the oracle's; 0.95 is required
  EXPECT_EQ(s.reached.tries, 2u);
  EXPECT_NEAR(s.ratio(), 0.78 / 1.6, 1e-12);
}

}  // namespace
}  // namespace joulecast::trial
