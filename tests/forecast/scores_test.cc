#include "forecast/scores.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "client/virtual_robot/rng.h"

namespace joulecast::forecast {
namespace {

using virtual_robot::Rng;

TEST(ScoreDistribution, PriorIsSymmetric) {
  const ScoreDistribution reference;
  double sum = 0, squares = 0;
  for (const double z : reference.atoms()) sum += z, squares += z * z;
  EXPECT_NEAR(sum, 0, 1e-9);
  // Forty points represent the distribution; the tails beyond the outermost hold a seventh of the variance.
  EXPECT_NEAR(squares / static_cast<double>(ScoreDistribution::count), 1, 0.2);
  EXPECT_NEAR(reference.quantile(0.5), 0, 1e-9);
  EXPECT_NEAR(reference.quantile(0.95), 2.015 * std::sqrt(0.6), 0.05);  // t(5) tabulated, 0.95 quantile
}

TEST(ScoreDistribution, QuantilesMatchAscendingAtoms) {
  Scores own;
  Rng rng(1);
  for (int k = 0; k < 50; ++k) own.add(rng.normal());
  const ScoreDistribution d = pooled_scores(own, {});
  EXPECT_TRUE(std::ranges::is_sorted(d.atoms()));
  EXPECT_EQ(d.quantile(0), d.atoms().front());
  EXPECT_EQ(d.quantile(1), d.atoms().back());
}

// Intervals cover for every distribution of scores: exchangeable scores of three shapes, the next one falls
// inside the 90 % interval of 60 before it in 90 % of 3000 trials, within four binomial deviations and the
// reference's share of the weight (2 of 47).
TEST(ScoreDistribution, CoversEveryShape) {
  Rng rng(2);
  const auto skewed = [&] { return -std::log(1 - rng.uniform()) - 1; };
  const auto two_humps = [&] { return (rng.chance(0.5) ? 1.0 : -1.0) + 0.1 * rng.normal(); };
  const auto heavy = [&] { return rng.normal() / std::sqrt(-std::log(1 - rng.uniform())); };
  int shape = 0;
  for (const std::function<double()>& draw :
       {std::function<double()>(skewed), std::function<double()>(two_humps),
        std::function<double()>(heavy)}) {
    int inside = 0;
    constexpr int trials = 3000;
    for (int t = 0; t < trials; ++t) {
      Scores own;
      for (int k = 0; k < 60; ++k) own.add(draw());
      const ScoreDistribution d = pooled_scores(own, {});
      const double next = draw();
      inside += next >= d.quantile(0.05) && next <= d.quantile(0.95);
    }
    EXPECT_NEAR(static_cast<double>(inside) / trials, 0.9,
                4 * std::sqrt(0.9 * 0.1 / trials) + reference_weight / 47)
        << shape;
    ++shape;
  }
}

// The same of twenty scores that scatter more than the reference, so that it does not help: without room for
// the score to come 85 % would fall inside.
TEST(ScoreDistribution, CoversFromFewScores) {
  Rng rng(3);
  int inside = 0;
  constexpr int trials = 20'000;
  const auto draw = [&] { return 2 * rng.normal(); };
  for (int t = 0; t < trials; ++t) {
    Scores own;
    for (int k = 0; k < 20; ++k) own.add(draw());
    const ScoreDistribution d = pooled_scores(own, {});
    const double next = draw();
    inside += next >= d.quantile(0.05) && next <= d.quantile(0.95);
  }
  const double coverage = static_cast<double>(inside) / trials;
  EXPECT_GT(coverage, 0.9 - 4 * std::sqrt(0.9 * 0.1 / trials));
  EXPECT_LT(coverage, 0.92);
}

TEST(ScoreDistribution, SiblingsFadeOut) {
  std::vector<Scores::Entry> siblings(100, Scores::Entry{3, 1});
  Scores own;
  EXPECT_NEAR(pooled_scores(own, siblings).quantile(0.5), 3, 1e-9);
  for (int k = 0; k < 60; ++k) own.add(-3);
  // Own weight is 45 by now, more than enough: siblings are no longer used.
  EXPECT_LT(pooled_scores(own, siblings).quantile(0.9), 0);
}

TEST(Scores, OldScoresFade) {
  Scores scores;
  for (int k = 0; k < 10; ++k) scores.add(k);
  EXPECT_EQ(scores.entries().back().weight, 1);
  EXPECT_NEAR(scores.entries().front().weight, std::pow(Scores::keep, 9), 1e-12);
  scores.add(1, 0.25);
  EXPECT_EQ(scores.entries().back().weight, 0.25);
  const double before = scores.weight();
  scores.discount(0.5);
  EXPECT_NEAR(scores.weight(), 0.5 * before, 1e-12);
}

}  // namespace
}  // namespace joulecast::forecast
