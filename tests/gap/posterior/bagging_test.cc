#include "gap/posterior/bagging.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/gap/posterior/made_problem.h"

namespace joulecast::gap::posterior {
namespace {

// Two models (none, and a load) and two blocks. Only the first block shows the load.
struct TwoModels {
  TwoModels() {
    grams.raw.assign(2, Information(1));
    grams.raw[0].xx(0, 0) = grams.raw[1].xx(0, 0) = 400;
    grams.raw[0].xy[0] = 90;
    grams.raw[1].xy[0] = -30;
    grams.of_factor.fill(grams.raw);
  }
  made::Problem p;
  Grams grams;
  Prior prior{p.catalogue, p.equations, {}, 1, true, Eigen::MatrixXd::Constant(1, 1, 800)};
  std::vector<Model> models{{{}, std::nullopt}, {{0}, std::nullopt}};

  // The formula of one normal coefficient, averaged over widths. Tolerances are zero, so factors have no
  // effect.
  double probability(double first, double second) const {
    const double g = 400 * (first + second), b = 90 * first - 30 * second;
    double sum = 0;
    for (const double share : slab_shares) {
      const double sd = prior.slab(0, share);
      sum += std::exp(0.5 * b * b / (g + 1 / (sd * sd)) - 0.5 * std::log1p(g * sd * sd)) / 4;
    }
    const double odds = sum * std::exp(prior.log_prior(0));
    return odds / (1 + odds);
  }
};

TEST(Probabilities, MatchesClosedForm) {
  const TwoModels two;
  const std::vector<double> once{1, 1};
  const Eigen::VectorXd p =
      probabilities(two.prior, reduce(two.p.equations, two.grams, once), two.models).model;
  EXPECT_NEAR(p[1], two.probability(1, 1), 1e-6);
}

TEST(Bagged, AveragesOverBlockResamples) {
  const TwoModels two;
  // Each of two blocks is drawn twice with probability 1/4, both once with 1/2.
  const double expected =
      0.25 * two.probability(2, 0) + 0.5 * two.probability(1, 1) + 0.25 * two.probability(0, 2);
  const Eigen::VectorXd p = bagged(two.prior, two.grams, two.models, 4000);
  EXPECT_NEAR(p[1], expected, 0.02);
  EXPECT_NEAR(p.sum(), 1, 1e-9);
  // The posterior of the first block drawn twice is near certainty; the average is lower.
  EXPECT_GT(two.probability(2, 0) - expected, 0.2);
}

}  // namespace
}  // namespace joulecast::gap::posterior
