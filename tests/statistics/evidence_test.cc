#include "statistics/evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace joulecast::statistics {
namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();
constexpr Eigen::Index evidence_rows = 12;

// Two columns with the correlation `alike`, and an unrelated third.
Eigen::MatrixXd design(double alike) {
  Eigen::MatrixXd x(evidence_rows, 3);
  for (Eigen::Index k = 0; k < evidence_rows; ++k) {
    const double turn = 2 * std::numbers::pi * static_cast<double>(k) / evidence_rows;
    x(k, 0) = std::cos(turn);
    x(k, 1) = alike * std::cos(turn) + std::sqrt(1 - alike * alike) * std::sin(turn);
    x(k, 2) = 0.3 * std::cos(2 * turn) + 0.4;
  }
  return x;
}

Eigen::VectorXd reading(const Eigen::MatrixXd& x) {
  Eigen::VectorXd y = x * Eigen::Vector3d(0.8, -0.3, 0.2);
  for (Eigen::Index k = 0; k < evidence_rows; ++k) y[k] += 0.9 * std::sin(7.0 * static_cast<double>(k * k));
  return y;
}

Information evidence_of(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
  Information info(x.cols());
  info.add(x, y);
  return info;
}

// Integrals over two coefficients of the density of y with its covariance times their priors, each normal
// within its bounds, over the density of y without them: by the midpoint rule.
struct Quadrature {
  double log_odds;
  Eigen::Vector2d mean, sd;
};

Quadrature integrate(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const Eigen::VectorXd& tolerance,
                     const Candidate& a, const Candidate& b) {
  const Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(evidence_rows, evidence_rows) +
                                     x * tolerance.cwiseAbs2().asDiagonal() * x.transpose();
  const Eigen::MatrixXd precise = covariance.inverse();
  const double nothing = -0.5 * y.dot(precise * y);
  constexpr int steps = 800;
  const auto low = [](const Candidate& c) { return std::max(c.least, -7 * c.expected); };
  const auto step = [&](const Candidate& c) { return (std::min(c.most, 7 * c.expected) - low(c)) / steps; };
  const auto prior = [](const Candidate& c, double v) {
    return std::exp(-0.5 * v * v / (c.expected * c.expected));
  };
  const Eigen::VectorXd xa = x.col(static_cast<Eigen::Index>(a.columns[0])),
                        xb = x.col(static_cast<Eigen::Index>(b.columns[0]));
  const double aa = xa.dot(precise * xa), ab = xa.dot(precise * xb), bb = xb.dot(precise * xb);
  const double ay = xa.dot(precise * y), by = xb.dot(precise * y);
  double mass = 0, prior_mass = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero(), second = Eigen::Vector2d::Zero();
  for (int i = 0; i < steps; ++i) {
    for (int j = 0; j < steps; ++j) {
      const Eigen::Vector2d v(low(a) + (i + 0.5) * step(a), low(b) + (j + 0.5) * step(b));
      const double p = prior(a, v[0]) * prior(b, v[1]);
      const double misfit = y.dot(precise * y) - 2 * (v[0] * ay + v[1] * by) + v[0] * v[0] * aa +
                            2 * v[0] * v[1] * ab + v[1] * v[1] * bb;
      const double density = p * std::exp(-0.5 * misfit - nothing);
      prior_mass += p;
      mass += density;
      first += density * v;
      second += density * v.cwiseAbs2();
    }
  }
  Quadrature q;
  q.log_odds = std::log(mass / prior_mass) + a.log_prior + b.log_prior;
  q.mean = first / mass;
  q.sd = (second / mass - q.mean.cwiseAbs2()).cwiseSqrt();
  return q;
}

double log_odds(const Evidence& evidence, const Candidate& a, const Candidate& b) {
  const std::vector<const Candidate*> set{&a, &b};
  return evidence.log_odds(set);
}

TEST(Evidence, MatchesIntegralOverTwoColumns) {
  const Candidate a{.columns = {0}, .expected = 0.7, .log_prior = -1.5},
      b{.columns = {1}, .expected = 0.4, .log_prior = -2};
  for (const double alike : {0.0, 0.8}) {
    const Eigen::MatrixXd x = design(alike);
    const Eigen::VectorXd y = reading(x);
    for (const Eigen::Vector3d& tolerance : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0.2, 0.5)}) {
      const Evidence evidence(evidence_of(x, y), tolerance);
      const Quadrature q = integrate(x, y, tolerance, a, b);
      EXPECT_NEAR(log_odds(evidence, a, b), q.log_odds, 1e-6);
      const std::vector<const Candidate*> set{&a, &b};
      const auto estimate = evidence.estimate(set);
      EXPECT_NEAR((estimate.mean - q.mean).norm(), 0, 1e-6);
      EXPECT_NEAR((estimate.sd - q.sd).norm(), 0, 1e-6);
      EXPECT_NEAR((estimate.covariance.diagonal().cwiseSqrt() - q.sd).norm(), 0, 1e-6);
    }
  }
}

TEST(Evidence, MatchesIntegralWithinBounds) {
  const Candidate positive{.columns = {0}, .expected = 0.7, .least = 0, .log_prior = -1};
  const Candidate negative{.columns = {0}, .expected = 0.7, .most = 0, .log_prior = -1};
  const Candidate between{.columns = {1}, .expected = 0.5, .least = -0.2, .most = 0.6};
  const Eigen::Vector3d tolerance(0, 0, 0);
  // Columns at right angles: exact.
  const Eigen::MatrixXd apart = design(0);
  const Evidence exact(evidence_of(apart, reading(apart)), tolerance);
  for (const Candidate& c : {positive, negative}) {
    EXPECT_NEAR(log_odds(exact, c, between), integrate(apart, reading(apart), tolerance, c, between).log_odds,
                1e-4);
  }
  EXPECT_GT(log_odds(exact, positive, between), log_odds(exact, negative, between) + 2);
  // Alike by a fifth: the mass is taken coefficient by coefficient.
  const Eigen::MatrixXd near = design(0.2);
  const Evidence close(evidence_of(near, reading(near)), tolerance);
  for (const Candidate& c : {positive, negative}) {
    EXPECT_NEAR(log_odds(close, c, between), integrate(near, reading(near), tolerance, c, between).log_odds,
                0.3);
  }
}

TEST(Evidence, WithoutCandidatesIsDataDensity) {
  const Eigen::MatrixXd x = design(0.3);
  const Eigen::VectorXd y = reading(x), tolerance = Eigen::Vector3d(0.1, 0.2, 0.5);
  Information info = evidence_of(x, y);
  info.log_scale = 3;
  const Evidence evidence(info, tolerance);
  const Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(evidence_rows, evidence_rows) +
                                     x * tolerance.cwiseAbs2().asDiagonal() * x.transpose();
  EXPECT_NEAR(evidence.log_density(),
              3 - 0.5 * y.dot(covariance.inverse() * y) - 0.5 * std::log(covariance.determinant()), 1e-10);
  EXPECT_EQ(evidence.log_odds({}), 0);
  EXPECT_EQ(evidence.estimate({}).mean.size(), 0);
}

TEST(Evidence, SubsetOfColumnsAgrees) {
  const Eigen::MatrixXd x = design(0.6);
  const Eigen::VectorXd y = reading(x), tolerance = Eigen::Vector3d(0.1, 0.2, 0.5);
  const Candidate a{.columns = {1, 2}, .expected = 0.7, .least = -1, .log_prior = -1};
  const std::vector<const Candidate*> set{&a};
  const Evidence whole(evidence_of(x, y), tolerance),
      part(evidence_of(x, y), tolerance, std::vector<std::size_t>{1, 2});
  EXPECT_NEAR(part.log_odds(set), whole.log_odds(set), 1e-12);
  EXPECT_NEAR((part.estimate(set).mean - whole.estimate(set).mean).norm(), 0, 1e-12);
  EXPECT_NEAR(part.separation(1, 0.5, 2, 0.7), whole.separation(1, 0.5, 2, 0.7), 1e-12);
}

TEST(Evidence, EstimatesStayWithinBounds) {
  const Eigen::MatrixXd x = design(0);
  const Evidence evidence(evidence_of(x, 3 * x.col(0)), Eigen::VectorXd::Zero(3));
  const Candidate low{.columns = {0}, .expected = 10, .least = -unbounded, .most = 0.5};
  const Candidate high{.columns = {0}, .expected = 10, .least = 4, .most = unbounded};
  const std::vector<const Candidate*> at_most{&low}, at_least{&high};
  EXPECT_EQ(evidence.estimate(at_most).mean[0], 0.5);
  EXPECT_EQ(evidence.estimate(at_least).mean[0], 4);
}

TEST(Evidence, SeparationIsTheResidualDistance) {
  const Eigen::MatrixXd x = design(0.9);
  const Evidence evidence(evidence_of(x, Eigen::VectorXd::Zero(evidence_rows)), Eigen::VectorXd::Zero(3));
  // The least of |s x_0 - b x_1|^2 + (b/expected)^2 over b, searched.
  constexpr double s = 0.7, expected = 0.5;
  double least = unbounded;
  for (double b = -2; b < 2; b += 1e-4) {
    least = std::min(least, (s * x.col(0) - b * x.col(1)).squaredNorm() + b * b / (expected * expected));
  }
  EXPECT_NEAR(evidence.separation(0, s, 1, expected), 0.5 * least, 1e-6);
  // A column follows itself within its expected size.
  EXPECT_NEAR(evidence.separation(0, s, 0, 1e6), 0, 1e-9);
}

TEST(Ridge, MatchesPosteriorOfAllCoefficients) {
  const Eigen::MatrixXd x = design(0.7);
  const Eigen::VectorXd y = reading(x), sd = Eigen::Vector3d(0.5, 2, 0);
  const Ridge r = ridge(evidence_of(x, y), sd);
  const Eigen::MatrixXd two = x.leftCols(2);
  const Eigen::Matrix2d precision =
      two.transpose() * two + Eigen::Matrix2d(Eigen::Vector2d(1 / 0.25, 1 / 4.0).asDiagonal());
  EXPECT_NEAR((r.covariance.topLeftCorner(2, 2) - precision.inverse()).norm(), 0, 1e-12);
  EXPECT_NEAR((r.mean.head(2) - precision.inverse() * two.transpose() * y).norm(), 0, 1e-12);
  EXPECT_EQ(r.mean[2], 0);
  EXPECT_EQ(r.covariance(2, 2), 0);
}

}  // namespace
}  // namespace joulecast::statistics
