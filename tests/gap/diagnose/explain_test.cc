#include "gap/diagnose/explain.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "dynamics/catalogue.h"
#include "gap/diagnose/mixture.h"

namespace joulecast::gap {
namespace {

// What one block says of two coefficients whose columns are at right angles.
struct Said {
  std::array<double, 2> weight, estimate;
};

constexpr std::array expected{0.5, 0.8};
constexpr std::array log_prior{-1.0, -2.0};

// Two effects that no other channel than power shows; each moves a tenth of the power.
Problem two_effects(const std::vector<Said>& blocks, const std::vector<Circumstances>& circumstances) {
  Problem problem;
  for (const char* id : {"coulomb_friction", "accessory_load"}) {
    const std::size_t k = problem.hypotheses.size();
    Hypothesis h;
    h.candidate = {.columns = {k}, .expected = expected[k], .log_prior = log_prior[k]};
    h.effect = dynamics::initial(*dynamics::find_effect(id));
    problem.hypotheses.push_back(h);
  }
  problem.circumstances = circumstances;
  problem.plain = {.log_prior = 0, .tolerance = Eigen::Vector2d::Zero(), .noise = 0};
  problem.blocks.resize(1);
  for (const Said& said : blocks) {
    statistics::Information block(2);
    for (Eigen::Index k = 0; k < 2; ++k) {
      const auto at = static_cast<std::size_t>(k);
      block.xx(k, k) = said.weight[at];
      block.xy[k] = said.weight[at] * said.estimate[at];
      block.yy += block.xy[k] * said.estimate[at];
    }
    problem.blocks[0].push_back(block);
  }
  problem.moved = [](const Hypothesis&, const Eigen::VectorXd&) { return 0.1; };
  problem.cancelling = [](const HypothesisSet&, const Eigen::VectorXd&) { return 1.0; };
  return problem;
}

Circumstances circumstances(double log_prior_of, double tolerance) {
  return {.log_prior = log_prior_of, .tolerance = Eigen::Vector2d::Constant(tolerance), .noise = 0};
}

double log_normal(double x, double variance) {
  return -0.5 * (std::log(2 * std::numbers::pi * variance) + x * x / variance);
}

// Log odds of one effect: its estimate is normal about zero, with the variance of the coefficient on top
// where the effect is there.
double log_odds_of(std::size_t k, double weight, double estimate, double tolerance) {
  const double without = 1 / weight + tolerance * tolerance;
  return log_prior[k] + log_normal(estimate, without + expected[k] * expected[k]) -
         log_normal(estimate, without);
}

// The first effect is seen; the second is as well nothing.
const std::vector<Said> six_blocks(6, Said{.weight = {20, 15}, .estimate = {0.4, 0.02}});

TEST(Mixture, OddsOfColumnsAtRightAnglesAreThoseOfTheirEstimates) {
  for (const double tolerance : {0.0, 0.1}) {
    const Problem problem = two_effects(six_blocks, {circumstances(0, tolerance)});
    const Mixture mixture(problem);
    const double first = log_odds_of(0, 120, 0.4, tolerance), second = log_odds_of(1, 90, 0.02, tolerance);
    EXPECT_NEAR(mixture.log_odds({0}), first, 1e-9);
    EXPECT_NEAR(mixture.log_odds({1}), second, 1e-9);
    EXPECT_NEAR(mixture.log_odds({0, 1}), first + second, 1e-9);
    const double other = tolerance * tolerance + 1.0 / 120, own = expected[0] * expected[0];
    const auto estimate = mixture.estimate({0});
    EXPECT_NEAR(estimate.mean[0], 0.4 * own / (own + other), 1e-9);
    EXPECT_NEAR(estimate.sd[0], std::sqrt(own * other / (own + other)), 1e-9);
  }
}

TEST(Mixture, CircumstancesCountByWhatTheyMakeOfTheData) {
  constexpr std::array tolerances{0.05, 0.2};
  constexpr std::array log_priors{std::log(0.7), std::log(0.3)};
  const Problem problem = two_effects(
      six_blocks, {circumstances(log_priors[0], tolerances[0]), circumstances(log_priors[1], tolerances[1])});
  double with = 0, without = 0, mean = 0;
  for (std::size_t c = 0; c < tolerances.size(); ++c) {
    const double t = tolerances[c] * tolerances[c];
    const double nothing =
        std::exp(log_priors[c] + log_normal(0.4, 1.0 / 120 + t) + log_normal(0.02, 1.0 / 90 + t));
    const double odds = std::exp(log_odds_of(0, 120, 0.4, tolerances[c]));
    const double own = expected[0] * expected[0];
    without += nothing;
    with += nothing * odds;
    mean += nothing * odds * 0.4 * own / (own + t + 1.0 / 120);
  }
  const Mixture mixture(problem);
  EXPECT_NEAR(mixture.log_odds({0}), std::log(with / without), 1e-9);
  EXPECT_NEAR(mixture.estimate({0}).mean[0], mean / with, 1e-9);
}

TEST(Mixture, BlocksThatAreLeftOutSayNothing) {
  std::vector<Said> blocks = six_blocks;
  blocks[2] = {.weight = {500, 500}, .estimate = {-3, 4}};
  const Problem problem = two_effects(blocks, {circumstances(0, 0.1)});
  const Mixture mixture(problem, {false, false, true, false, false, false});
  EXPECT_NEAR(mixture.log_odds({0}), log_odds_of(0, 100, 0.4, 0.1), 1e-9);
  EXPECT_NEAR(mixture.log_odds({1}), log_odds_of(1, 75, 0.02, 0.1), 1e-9);
}

TEST(Mixture, WanderIsThatOfTheStrengthFromBlockToBlock) {
  const auto mean_of = [](const Mixture& mixture) {
    const std::vector<double> probability = mixture.wander({0}, 0);
    double mean = 0;
    for (std::size_t k = 0; k < probability.size(); ++k) mean += probability[k] * wander_grid[k];
    return mean;
  };
  std::vector<Said> blocks(10, Said{.weight = {2000, 15}, .estimate = {0.4, 0}});
  const Problem still = two_effects(blocks, {circumstances(0, 0.01)});
  EXPECT_LT(mean_of(Mixture(still)), 0.1);
  for (const double strength : Mixture(still).by_block({0}, 0)) EXPECT_NEAR(strength, 0.4, 0.01);
  for (std::size_t b = 0; b < blocks.size(); ++b) blocks[b].estimate[0] = b % 2 == 0 ? 0.1 : 0.7;
  const Problem moving = two_effects(blocks, {circumstances(0, 0.01)});
  EXPECT_NEAR(mean_of(Mixture(moving)), 0.75, 0.25);
  const std::vector<double> strengths = Mixture(moving).by_block({0}, 0);
  EXPECT_NEAR(strengths[0], 0.1, 0.02);
  EXPECT_NEAR(strengths[1], 0.7, 0.02);
}

TEST(Mixture, ChangesFromBlockToBlockOfAColouredNoiseAreNoWander) {
  const auto mean_of = [](const std::vector<Said>& blocks) {
    const Problem problem = two_effects(blocks, {circumstances(0, 0.01)});
    return Mixture(problem).mean_wander({0}, 0);
  };
  std::vector<Said> blocks(64, Said{.weight = {2000, 15}, .estimate = {0.4, 0}});
  for (std::size_t b = 0; b < blocks.size(); ++b) blocks[b].estimate[0] = b % 2 == 0 ? 0.3 : 0.5;
  const double alternating = mean_of(blocks);
  EXPECT_LT(alternating, 0.1);
  for (std::size_t b = 0; b < blocks.size(); ++b) blocks[b].estimate[0] = b < 32 ? 0.3 : 0.5;
  EXPECT_GT(mean_of(blocks), 2 * alternating);
}

HypothesisSet members_of(const Explanation& e) {
  HypothesisSet set;
  for (const Member& m : e.members) set.push_back(m.hypothesis);
  return set;
}

TEST(Explain, ProbabilitiesAreThoseOfAllSetsOfTwo) {
  const Problem problem = two_effects(six_blocks, {circumstances(0, 0.1)});
  const double first = std::exp(log_odds_of(0, 120, 0.4, 0.1)),
               second = std::exp(log_odds_of(1, 90, 0.02, 0.1));
  ASSERT_GT(first, 1);
  ASSERT_LT(second, 1);
  const Explanation e = explain(problem);
  EXPECT_NEAR(e.none, 1 / ((1 + first) * (1 + second)), 1e-9);
  EXPECT_EQ(e.outside, 0);
  ASSERT_EQ(members_of(e), HypothesisSet{0});
  const Member& m = e.members.front();
  EXPECT_NEAR(m.by_evidence, first / (1 + first), 1e-9);
  // All blocks say it, and without tolerances clearly: whichever are drawn.
  EXPECT_GT(m.by_prediction, 0.99);
  EXPECT_LT(e.none_by_prediction, 0.01);
  EXPECT_TRUE(m.alternatives.empty() || m.alternatives[0].odds > 0.04);
}

TEST(Explain, WhatOneBlockAloneSaysIsNotPredicted) {
  std::vector<Said> blocks(6, Said{.weight = {20, 15}, .estimate = {0, 0}});
  blocks[3].estimate[0] = 2.5;
  const Problem problem = two_effects(blocks, {circumstances(0, 0)});
  const Explanation e = explain(problem);
  ASSERT_EQ(members_of(e), HypothesisSet{0});
  EXPECT_GT(e.members[0].by_evidence, 0.9);
  EXPECT_LT(e.members[0].by_prediction, 0.5);
  EXPECT_LT(e.members[0].probability(), 0.5);
}

TEST(Explain, TheLikeliestIsACandidateWhereNoneIsLikely) {
  const std::vector<Said> blocks(6, Said{.weight = {20, 15}, .estimate = {0.28, 0.02}});
  const double odds = std::exp(log_odds_of(0, 120, 0.28, 0.1));
  ASSERT_GT(odds, 0.2);
  ASSERT_LT(odds, 0.8);
  Problem problem = two_effects(blocks, {circumstances(0, 0.1)});
  EXPECT_TRUE(explain(problem).members.empty());
  ExplainSettings settings;
  settings.candidate = true;
  const Mixture mixture(problem);
  const Explanation e = explain(mixture, std::vector<bool>(), settings);
  ASSERT_EQ(members_of(e), HypothesisSet{0});
  EXPECT_TRUE(e.members[0].candidate);
  EXPECT_NEAR(e.members[0].probability(), std::min(0.45, odds / (1 + odds)), 1e-9);
  problem.moved = [](const Hypothesis&, const Eigen::VectorXd&) { return 0.001; };
  EXPECT_TRUE(explain(mixture, std::vector<bool>(), settings).members.empty());
}

TEST(Explain, WhatTheDataShowAsTheSameIsToldWhateverTheOdds) {
  const std::vector<Said> blocks(6, Said{.weight = {200, 150}, .estimate = {0.8, 0.02}});
  Problem problem = two_effects(blocks, {circumstances(0, 0.1)});
  EXPECT_TRUE(explain(problem).members.at(0).alternatives.empty());
  problem.likeness = [](const Hypothesis&, const Hypothesis&) { return 0.98; };
  EXPECT_TRUE(explain(problem).members.at(0).alternatives.empty());
  problem.likeness = [](const Hypothesis&, const Hypothesis&) { return 0.995; };
  const Explanation e = explain(problem);
  ASSERT_EQ(e.members.at(0).alternatives.size(), 1u);
  EXPECT_EQ(e.members[0].alternatives[0].hypothesis, 1u);
}

TEST(Explain, WhatHardlyMovesPowerIsNoMember) {
  Problem problem = two_effects(six_blocks, {circumstances(0, 0.1)});
  problem.moved = [](const Hypothesis&, const Eigen::VectorXd&) { return 0.001; };
  const Explanation e = explain(problem);
  EXPECT_TRUE(e.members.empty());
  EXPECT_NEAR(e.none, 1, 1e-9);
  EXPECT_EQ(e.whole, HypothesisSet{0});
}

TEST(Explain, FunctionsOutsideTheCatalogueCountAsSuch) {
  Problem problem = two_effects(six_blocks, {circumstances(0, 0.1)});
  problem.hypotheses[0].effect.effect = nullptr;
  problem.hypotheses[0].channel = "wheel_torque";
  problem.hypotheses[0].variable = "heading";
  const double odds = std::exp(log_odds_of(0, 120, 0.4, 0.1));
  const Explanation e = explain(problem);
  EXPECT_NEAR(e.outside, odds / (1 + odds), 1e-9);
  EXPECT_EQ(members_of(e), HypothesisSet{0});
}

}  // namespace
}  // namespace joulecast::gap
