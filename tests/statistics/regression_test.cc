#include "statistics/regression.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "statistics/distributions.h"

namespace joulecast::statistics {
namespace {

// Every row a block of its own.
std::vector<std::size_t> each(Eigen::Index n) {
  std::vector<std::size_t> block(static_cast<std::size_t>(n));
  std::iota(block.begin(), block.end(), 0u);
  return block;
}

Eigen::MatrixXd line(Eigen::Index n) {
  Eigen::MatrixXd x(n, 2);
  for (Eigen::Index k = 0; k < n; ++k) x.row(k) << 1, std::cos(0.7 * static_cast<double>(k));
  return x;
}

Eigen::VectorXd noise(Eigen::Index n, double sd, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, sd);
  return Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
}

// The best of all subsets of the signed terms whose least squares keep the signs.
TEST(SignedSolution, MatchesBestAdmissibleSubset) {
  const std::vector<bool> nonnegative{true, true, false, true, true};
  for (std::uint64_t seed = 1; seed < 40; ++seed) {
    const Eigen::MatrixXd x = noise(100, 1, seed).reshaped(20, 5);
    const Eigen::VectorXd y = noise(20, 1, seed + 100);
    double least = y.squaredNorm();
    for (unsigned bits = 0; bits < 32; ++bits) {
      std::vector<Eigen::Index> own;
      for (Eigen::Index k = 0; k < 5; ++k) {
        if ((bits >> k & 1U) != 0) own.push_back(k);
      }
      if (own.empty()) continue;
      const Eigen::MatrixXd part = x(Eigen::all, own);
      const Eigen::VectorXd b = part.colPivHouseholderQr().solve(y);
      bool admissible = true;
      for (std::size_t k = 0; k < own.size(); ++k)
        admissible &= !nonnegative[static_cast<std::size_t>(own[k])] || b[static_cast<Eigen::Index>(k)] >= 0;
      if (admissible) least = std::min(least, (y - part * b).squaredNorm());
    }
    const Eigen::VectorXd b = signed_solution(x.transpose() * x, x.transpose() * y, nonnegative);
    EXPECT_NEAR((y - x * b).squaredNorm(), least, 1e-9 * least);
    EXPECT_GE(std::min({b[0], b[1], b[3], b[4]}), 0);
  }
}

TEST(RobustRegression, KeepsSignsAndWeights) {
  const Eigen::MatrixXd x = line(400);
  Eigen::VectorXd y = x * Eigen::Vector2d(3, -2) + noise(400, 0.1, 4);
  y[7] += 1000;
  const Regression r = robust_regression(x, y, each(400), {true, true});
  EXPECT_EQ(r.coefficients[1], 0);
  EXPECT_GT(r.coefficients[0], 0);
  EXPECT_LT(r.weight[7], 0.01);
}

TEST(RobustRegression, IsExactWithoutErrors) {
  const Eigen::MatrixXd x = line(50);
  const Regression r = robust_regression(x, x * Eigen::Vector2d(3, -200), each(50));
  EXPECT_NEAR(r.coefficients[0], 3, 1e-9);
  EXPECT_NEAR(r.coefficients[1], -200, 1e-9);
  EXPECT_NEAR(r.spread, 0, 1e-9);
}

TEST(RobustRegression, ResistsAFewOutliers) {
  constexpr Eigen::Index n = 2000;
  const Eigen::MatrixXd x = line(n);
  Eigen::VectorXd y = x * Eigen::Vector2d(3, 5) + noise(n, 0.1, 2);
  for (Eigen::Index k = 0; k < n; k += 20) y[k] += 1000;
  const Regression r = robust_regression(x, y, each(n));
  // Least squares would be off by 1000/20 = 50.
  EXPECT_NEAR(r.coefficients[0], 3, 0.02);
  EXPECT_NEAR(r.coefficients[1], 5, 0.02);
  EXPECT_NEAR(r.spread, 0.1, 0.02);
}

// Of normal errors Huber's estimator at 1.345 needs 1/0.95 of least squares' data.
TEST(RobustRegression, DeviationsMatchNormalErrors) {
  constexpr Eigen::Index n = 40000;
  const Eigen::MatrixXd x = line(n);
  const Regression r = robust_regression(x, noise(n, 2, 3), each(n));
  const double root = std::sqrt(static_cast<double>(n));
  EXPECT_NEAR(r.sd[0] * root / (2 / std::sqrt(0.95)), 1, 0.02);
  EXPECT_NEAR(r.sd[1] * root / (2 * std::sqrt(2.0) / std::sqrt(0.95)), 1, 0.02);
  EXPECT_NEAR(r.spread, 2, 0.03);
}

TEST(RobustRegression, StatedDeviationsMatchScatter) {
  // Blocks of 10 rows share most of their error.
  constexpr Eigen::Index blocks = 60, n = 10 * blocks;
  const Eigen::MatrixXd x = line(n).leftCols(1);
  std::vector<std::size_t> block;
  for (Eigen::Index k = 0; k < n; ++k) block.push_back(static_cast<std::size_t>(k / 10));
  double square = 0, stated = 0, naive = 0;
  constexpr int cases = 400;
  for (int c = 0; c < cases; ++c) {
    const auto seed = static_cast<std::uint64_t>(10 * c);
    Eigen::VectorXd y = noise(n, 0.5, seed);
    const Eigen::VectorXd shared = noise(blocks, 1, seed + 1);
    for (Eigen::Index k = 0; k < n; ++k) y[k] += shared[k / 10];
    const Regression r = robust_regression(x, y, block);
    square += r.coefficients[0] * r.coefficients[0] / cases;
    stated += r.sd[0] * r.sd[0] / cases;
    naive += std::pow(robust_regression(x, y, each(n)).sd[0], 2) / cases;
  }
  EXPECT_NEAR(std::sqrt(stated / square), 1, 0.1);
  EXPECT_LT(std::sqrt(naive / square), 0.5);
}

TEST(RobustRegression, RepeatedRowsAddNoInformation) {
  constexpr Eigen::Index n = 30, times = 5;
  const Eigen::MatrixXd x = line(n);
  const Eigen::VectorXd y = x * Eigen::Vector2d(1, 2) + noise(n, 0.3, 4);
  const Regression once = robust_regression(x, y, each(n));
  // The order of rows does not matter either.
  std::vector<std::size_t> block;
  for (Eigen::Index t = 0; t < times; ++t) {
    for (std::size_t k = 0; k < n; ++k) block.push_back(k);
  }
  const Regression again = robust_regression(x.replicate(times, 1), y.replicate(times, 1), block);
  EXPECT_NEAR((again.coefficients - once.coefficients).norm(), 0, 1e-6);
  EXPECT_NEAR((again.sd - once.sd).norm(), 0, 1e-6);
}

TEST(RobustRegression, OneBlockUsesRowDeviations) {
  const Eigen::MatrixXd x = line(100);
  const Eigen::VectorXd y = noise(100, 1, 5);
  const Regression one = robust_regression(x, y, std::vector<std::size_t>(100, 7));
  EXPECT_EQ((one.sd - robust_regression(x, y, each(100)).sd).norm(), 0);
  EXPECT_NEAR(one.sd[0], 0.1, 0.03);
}

TEST(RobustRegression, EqualTermsShareTheirCoefficient) {
  const Eigen::MatrixXd two = line(80);
  Eigen::MatrixXd x(80, 4);
  x << two.col(0), two.col(1), 10 * two.col(1), Eigen::VectorXd::Zero(80);
  const Eigen::VectorXd y = two * Eigen::Vector2d(4, 6);
  const Regression r = robust_regression(x, y, each(80));
  EXPECT_NEAR((x * r.coefficients - y).norm(), 0, 1e-9);
  // Each in its own scale takes half.
  EXPECT_NEAR(r.coefficients[1], 3, 1e-9);
  EXPECT_NEAR(r.coefficients[2], 0.3, 1e-9);
  EXPECT_EQ(r.coefficients[3], 0);
  EXPECT_EQ(r.sd[3], 0);
}

TEST(RobustRegression, HandlesNoData) {
  const Regression r = robust_regression(Eigen::MatrixXd(0, 2), Eigen::VectorXd(0), {});
  EXPECT_EQ(r.coefficients, Eigen::Vector2d::Zero());
  EXPECT_EQ(r.sd, Eigen::Vector2d::Zero());
}

}  // namespace
}  // namespace joulecast::statistics
