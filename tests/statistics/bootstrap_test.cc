#include "statistics/bootstrap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <vector>

namespace joulecast::statistics {
namespace {

double mean_of(const std::vector<double>& values, std::span<const int> draw) {
  double sum = 0;
  for (std::size_t k = 0; k < values.size(); ++k) sum += draw[k] * values[k];
  return sum / static_cast<double>(values.size());
}

TEST(BootstrapCounts, DrawEveryBlockCount) {
  const auto counts = bootstrap_counts(30, 200, 7);
  ASSERT_EQ(counts.size(), 200u);
  double squares = 0;
  for (const auto& draw : counts) {
    EXPECT_EQ(std::accumulate(draw.begin(), draw.end(), 0), 30);
    for (const int n : draw) squares += n * n;
  }
  // A count is binomial(30, 1/30): its mean square is 1 + 29/30.
  EXPECT_NEAR(squares / 6000, 1 + 29.0 / 30, 0.1);
}

TEST(BootstrapCounts, AreReproducibleBySeed) {
  EXPECT_EQ(bootstrap_counts(12), bootstrap_counts(12));
  EXPECT_NE(bootstrap_counts(12, 400, 1), bootstrap_counts(12, 400, 2));
}

TEST(BootstrapInterval, MatchesNormalIntervalOfMean) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal(3, 2);
  std::vector<double> values(200);
  for (double& v : values) v = normal(random);
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / 200;
  double square = 0;
  for (const double v : values) square += (v - mean) * (v - mean);
  const auto interval = bootstrap_interval(
      200, [&](std::span<const int> draw) { return mean_of(values, draw); }, 4000);
  const double half = 1.96 * std::sqrt(square) / 200;
  EXPECT_NEAR(interval[0], mean - half, 0.06 * half);
  EXPECT_NEAR(interval[1], mean + half, 0.06 * half);
}

TEST(BootstrapInterval, CoversTheMeanOfGaussians) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal(-5, 3);
  int covered = 0;
  constexpr int cases = 1000;
  for (int n = 0; n < cases; ++n) {
    std::vector<double> values(40);
    for (double& v : values) v = normal(random);
    const auto interval =
        bootstrap_interval(40, [&](std::span<const int> draw) { return mean_of(values, draw); });
    covered += interval[0] <= -5 && -5 <= interval[1] ? 1 : 0;
  }
  // Percentiles of 40 values cover 0.938; the share of 1000 cases has a standard deviation of 0.0076.
  EXPECT_NEAR(covered / static_cast<double>(cases), 0.938, 0.02);
}

TEST(BootstrapInterval, OmitsNonFiniteValues) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto some =
      bootstrap_interval(5, [&](std::span<const int> draw) { return draw[0] == 0 ? nan : 2.0; });
  EXPECT_EQ(some[0], 2);
  EXPECT_EQ(some[1], 2);
  const auto none = bootstrap_interval(5, [&](std::span<const int>) { return nan; });
  EXPECT_TRUE(std::isnan(none[0]) && std::isnan(none[1]));
}

TEST(BootstrapInterval, OneBlockHasNoInterval) {
  for (const std::size_t blocks : {0u, 1u}) {
    const auto interval = bootstrap_interval(blocks, [](std::span<const int>) { return 1.0; });
    EXPECT_TRUE(std::isnan(interval[0]) && std::isnan(interval[1])) << blocks;
  }
}

}  // namespace
}  // namespace joulecast::statistics
