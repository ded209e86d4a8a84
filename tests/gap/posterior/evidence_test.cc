#include "gap/posterior/evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/gap/posterior/made_problem.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

double normal_density(double t, double sd) {
  return std::exp(-0.5 * t * t / (sd * sd)) / (sd * std::sqrt(2 * std::numbers::pi));
}

// Simpson's rule.
template <class F>
double integral(double from, double to, const F& f) {
  constexpr int steps = 4000;
  const double h = (to - from) / steps;
  double sum = f(from) + f(to);
  for (int k = 1; k < steps; ++k) sum += (k % 2 == 1 ? 4 : 2) * f(from + k * h);
  return sum * h / 3;
}

Eigen::VectorXd of(double v) {
  return Eigen::VectorXd::Constant(1, v);
}

struct Case {
  double g, b, sd, least, most;
};
class EvidenceOfOne : public ::testing::TestWithParam<Case> {};

TEST_P(EvidenceOfOne, MatchesNumericalQuadrature) {
  const auto [g, b, sd, least, most] = GetParam();
  const double from = std::max(least, -12.0), to = std::min(most, 12.0);
  const double mass = integral(from, to, [&](double t) { return normal_density(t, sd); });
  const double expected = std::log(integral(
      from, to, [&](double t) { return std::exp(b * t - 0.5 * g * t * t) * normal_density(t, sd) / mass; }));
  EXPECT_NEAR(
      evidence_of(Eigen::MatrixXd::Constant(1, 1, g), of(b), of(sd), of(least), of(most)).log_evidence,
      expected, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Cases, EvidenceOfOne,
                         ::testing::Values(Case{9, 12, 0.7, -infinite, infinite},
                                           Case{9, 12, 0.7, 0, infinite}, Case{9, -12, 0.7, 0, infinite},
                                           Case{2, 5, 1.5, -0.5, 1}, Case{0.01, 0.1, 1, 0, infinite}));

TEST(EvidenceOfTwo, MatchesNumericalQuadrature) {
  Eigen::Matrix2d g;
  g << 5, 2, 2, 3;
  const Eigen::Vector2d b(4, -1), sd(0.8, 1.2);
  const auto density = [&](double s, double t) {
    const Eigen::Vector2d v(s, t);
    return std::exp(b.dot(v) - 0.5 * v.dot(g * v)) * normal_density(s, sd[0]) * normal_density(t, sd[1]);
  };
  constexpr int steps = 600;
  constexpr double wide = 8, h = 2 * wide / steps;
  double sum = 0;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) sum += density(-wide + i * h, -wide + j * h);
  }
  const Eigen::Vector2d none = Eigen::Vector2d::Constant(-infinite);
  EXPECT_NEAR(evidence_of(g, b, sd, none, -none).log_evidence, std::log(sum * h * h), 1e-8);
}

TEST(EvidenceOfOneStrength, IgnoresUninformativeData) {
  EXPECT_NEAR(evidence_of(Eigen::MatrixXd::Zero(1, 1), of(0), of(2), of(0), of(infinite)).log_evidence, 0,
              1e-12);
}

TEST(EvidenceOfOneStrength, PositivePriorGainsLogTwo) {
  const Eigen::MatrixXd g = Eigen::MatrixXd::Constant(1, 1, 1e4);
  const double free = evidence_of(g, of(1e4), of(1), of(-infinite), of(infinite)).log_evidence;
  EXPECT_NEAR(evidence_of(g, of(1e4), of(1), of(0), of(infinite)).log_evidence - free, std::log(2), 1e-9);
}

TEST(EvidenceOfOneStrength, ReturnsPosteriorMeanAndDeviation) {
  const SetEvidence e =
      evidence_of(Eigen::MatrixXd::Constant(1, 1, 3), of(8), of(1), of(-infinite), of(infinite));
  EXPECT_NEAR(e.mean[0], 2, 1e-12);  // precision 3 + 1
  EXPECT_NEAR(e.sd[0], 0.5, 1e-12);
}

TEST(Enumerate, KeepsNoneAndSingles) {
  made::Problem p(true);
  Reduced reduced;
  reduced.information = Information(2);
  reduced.information.xx = Eigen::Matrix2d::Identity() * 1e4;
  reduced.information.xy = Eigen::Vector2d(3e3, 0);
  const Prior prior(p.catalogue, p.equations, {}, 1, true, reduced.information.xx);
  const std::vector<Model> models = enumerate(prior, reduced);
  const auto has = [&](std::vector<std::size_t> set) { return std::ranges::count(models, set, &Model::set); };
  EXPECT_EQ(has({}), 1);
  EXPECT_EQ(has({0}), 1);
  EXPECT_EQ(has({1}), 1);
  EXPECT_EQ(has({0, 1}), 1);
}

TEST(PriorOfSets, ExcludesPairsOfSimilarColumns) {
  made::Problem p(true);
  Eigen::Matrix2d raw;
  raw << 1, 0.97, 0.97, 1;
  EXPECT_TRUE(Prior(p.catalogue, p.equations, {}, 1, true, raw).excludes(0, 1));
  raw(0, 1) = raw(1, 0) = 0.9;
  EXPECT_FALSE(Prior(p.catalogue, p.equations, {}, 1, true, raw).excludes(0, 1));
}

}  // namespace
}  // namespace joulecast::gap::posterior
