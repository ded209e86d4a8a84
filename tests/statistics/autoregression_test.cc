#include "statistics/autoregression.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace joulecast::statistics {
namespace {

// Every `run` rows begin anew; 0: never.
std::vector<bool> runs(std::size_t n, std::size_t run = 0) {
  std::vector<bool> continues(n);
  for (std::size_t k = 1; k < n; ++k) continues[k] = run == 0 || k % run != 0;
  return continues;
}

Eigen::VectorXd simulate(const Autoregression& ar, Eigen::Index n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd y(n);
  double last = 0, before = 0;
  for (Eigen::Index k = -200; k < n; ++k) {
    const double now = ar.one * last + ar.two * before + normal(random);
    before = last;
    last = now;
    if (k >= 0) y[k] = now;
  }
  return y;
}

double correlation(const Eigen::VectorXd& y, Eigen::Index lag) {
  const Eigen::Index n = y.size() - lag;
  return y.head(n).dot(y.tail(n)) / y.squaredNorm();
}

// Autocovariances of Box and Jenkins (3.2.24) to (3.2.28), of an innovation of one.
Eigen::MatrixXd covariance(const Autoregression& ar, const std::vector<bool>& continues) {
  const auto n = static_cast<Eigen::Index>(continues.size());
  Eigen::VectorXd at(n + 1);
  at[0] = (1 - ar.two) / ((1 + ar.two) * ((1 - ar.two) * (1 - ar.two) - ar.one * ar.one));
  at[1] = at[0] * ar.one / (1 - ar.two);
  for (Eigen::Index lag = 2; lag <= n; ++lag) at[lag] = ar.one * at[lag - 1] + ar.two * at[lag - 2];
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = a; b < n; ++b) {
      if (b > a && !continues[static_cast<std::size_t>(b)]) break;
      c(a, b) = c(b, a) = at[b - a];
    }
  }
  return c;
}

TEST(Whiten, IsTheInverseOfTheCovariance) {
  for (const Autoregression ar : {Autoregression{0.7, 0}, {1.2, -0.5}, {0.3, 0.5}, {-0.6, 0.2}, {0, 0}}) {
    for (const std::size_t run : {0u, 1u, 2u, 5u}) {
      const auto continues = runs(13, run);
      Eigen::MatrixXd w = Eigen::MatrixXd::Identity(13, 13);
      whiten(w, continues, ar);
      EXPECT_NEAR((w * covariance(ar, continues) * w.transpose() - Eigen::MatrixXd::Identity(13, 13)).norm(),
                  0, 1e-12)
          << ar.one << " " << ar.two << " " << run;
    }
  }
}

TEST(Whiten, TreatsVectorsAsColumns) {
  const auto continues = runs(40, 7);
  Eigen::VectorXd y = simulate({0.5, 0.2}, 40, 1);
  Eigen::MatrixXd x = y;
  whiten(y, continues, {0.5, 0.2});
  whiten(x, continues, {0.5, 0.2});
  EXPECT_EQ((x.col(0) - y).norm(), 0);
}

// The variance of the mean of a first-order process is (1 + phi)/(1 - phi) times that of as many independent
// values (Box and Jenkins 2.1.13).
TEST(Whiten, AMeanIsKnownLessByTheProcessesCorrelation) {
  for (const double phi : {0.6, -0.4}) {
    constexpr Eigen::Index n = 4000;
    Eigen::MatrixXd x = Eigen::MatrixXd::Ones(n, 1);
    whiten(x, runs(n), {phi, 0});
    const double process = 1 / (1 - phi * phi), of_mean = 1 / x.squaredNorm();
    EXPECT_NEAR(of_mean * n / process / ((1 + phi) / (1 - phi)), 1, 2e-3) << phi;
  }
}

TEST(FitAutoregression, FindsTheCoefficientsAndLeavesWhiteNoise) {
  constexpr Eigen::Index n = 20000;
  const double three_sd = 3 / std::sqrt(static_cast<double>(n));
  for (const Autoregression ar : {Autoregression{0.7, 0}, {1.2, -0.5}, {0.3, 0.4}, {-0.5, 0}, {0, 0}}) {
    Eigen::VectorXd y = simulate(ar, n, 3);
    const double spread = std::sqrt(y.squaredNorm() / static_cast<double>(n));
    const Autoregression fit = fit_autoregression(y, runs(n), spread, 10);
    EXPECT_NEAR(fit.one, ar.one, three_sd);
    EXPECT_NEAR(fit.two, ar.two, three_sd);
    whiten(y, runs(n), fit);
    for (const Eigen::Index lag : {1, 2, 3, 7})
      EXPECT_NEAR(correlation(y, lag), 0, 1.2 * three_sd) << ar.one << " " << lag;
    EXPECT_NEAR(y.squaredNorm() / static_cast<double>(n), 1, 1.5 * three_sd);
  }
}

TEST(FitAutoregression, ClipsOutliers) {
  constexpr Eigen::Index n = 20000;
  Eigen::VectorXd y = simulate({0.7, 0}, n, 5);
  for (Eigen::Index k = 0; k < n; k += 500) y[k] = 1e4;
  EXPECT_NEAR(fit_autoregression(y, runs(n), 1.4, 3).one, 0.7, 0.05);
  EXPECT_NEAR(fit_autoregression(y, runs(n), 1.4, 1e9).one, 0, 0.05);
}

TEST(FitAutoregression, KeepsRunsApart) {
  // Runs of four rows with an offset of their own; across them nothing is alike.
  constexpr Eigen::Index n = 8000;
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  Eigen::VectorXd y(n);
  for (Eigen::Index k = 0; k < n; ++k)
    y[k] = k % 4 == 0 ? normal(random) : 0.9 * y[k - 1] + std::sqrt(0.19) * normal(random);
  const Autoregression fit = fit_autoregression(y, runs(n, 4), 1, 10);
  EXPECT_NEAR(fit.one, 0.9, 0.03);
  EXPECT_NEAR(fit.two, 0, 0.03);
}

TEST(FitAutoregression, StaysStationaryAndKeepsRows) {
  // A drift and an alternation are next to what no filter may take away.
  Eigen::VectorXd drift(500), swing(500);
  for (Eigen::Index k = 0; k < 500; ++k)
    drift[k] = 1 + 1e-3 * static_cast<double>(k), swing[k] = k % 2 == 0 ? 1 : -1;
  for (const Eigen::VectorXd& y : {drift, swing}) {
    const Autoregression fit = fit_autoregression(y, runs(500), 1, 10);
    EXPECT_GT(std::fabs(fit.one) + fit.two, 0.9);
    EXPECT_LE(std::fabs(fit.one) + fit.two, 0.95 + 1e-12);
    EXPECT_LE(std::fabs(fit.two), 0.6);
  }
}

TEST(FitAutoregression, NeedsRowsThatFollowEachOther) {
  const Eigen::VectorXd y = simulate({0.7, 0}, 200, 9);
  const auto none = [](const Autoregression& ar) { return ar.one == 0 && ar.two == 0; };
  EXPECT_TRUE(none(fit_autoregression(y, runs(200, 2), 1, 10)));
  EXPECT_TRUE(none(fit_autoregression(y.head(31), runs(31), 1, 10)));
  EXPECT_FALSE(none(fit_autoregression(y.head(32), runs(32), 1, 10)));
  EXPECT_TRUE(none(fit_autoregression(Eigen::VectorXd::Zero(200), runs(200), 1, 10)));
}

}  // namespace
}  // namespace joulecast::statistics
