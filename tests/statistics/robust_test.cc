#include "statistics/robust.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "statistics/distributions.h"

namespace joulecast::statistics {
namespace {

TEST(Median, IsTheMiddle) {
  EXPECT_EQ(median({7}), 7);
  EXPECT_EQ(median({3, -1, 2}), 2);
  EXPECT_EQ(median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(median({5, 5, 1, 5}), 5);
}

TEST(Quantile, IsLinearBetweenNeighbours) {
  const std::vector<double> values{9, 0, 3, 7, 1, 8, 2, 6, 4, 5, 10};
  EXPECT_EQ(quantile(values, 0), 0);
  EXPECT_EQ(quantile(values, 0.25), 2.5);
  EXPECT_EQ(quantile(values, 0.5), median(values));
  EXPECT_EQ(quantile(values, 0.91), 9.1);
  EXPECT_EQ(quantile(values, 1), 10);
  EXPECT_EQ(quantile({3}, 0.7), 3);
}

// Quantiles of a normal distribution as sample, without randomness.
std::vector<double> normal_sample(std::size_t n, double sd) {
  std::vector<double> values;
  for (std::size_t k = 0; k < n; ++k)
    values.push_back(sd * normal_quantile((static_cast<double>(k) + 0.5) / static_cast<double>(n)));
  return values;
}

TEST(SpreadAboutZero, MatchesDeviationOfNormalValues) {
  for (const double sd : {0.01, 1.0, 300.0})
    EXPECT_NEAR(spread_about_zero(normal_sample(10000, sd)) / sd, 1, 1e-3);
}

TEST(SpreadAboutZero, OutliersAddAFifth) {
  for (const double outlier : {1e2, -1e9}) {
    auto values = normal_sample(10000, 1);
    for (std::size_t k = 0; k < values.size(); k += 10) values[k] = outlier;
    // Then all that is kept is normal, with a mean size of sqrt(2/pi).
    EXPECT_NEAR(spread_about_zero(values), std::sqrt(2 / 3.14159265358979) / 0.6573, 2e-3);
  }
}

TEST(SpreadAboutZero, IsPositiveWithManyZeros) {
  // 60 % zeros, 40 % of size 1: of the nine tenths kept a third are 1.
  std::vector<double> values(100, 0.0);
  for (std::size_t k = 0; k < 40; ++k) values[k] = k % 2 == 0 ? 1 : -1;
  EXPECT_NEAR(spread_about_zero(values), 30.0 / 90 / 0.6573, 1e-12);
}

TEST(SpreadAboutZero, HandlesFewValues) {
  EXPECT_EQ(spread_about_zero({}), 0);
  EXPECT_NEAR(spread_about_zero(std::vector<double>{-2}), 2 / 0.6573, 1e-12);
  EXPECT_EQ(spread_about_zero(std::vector<double>(20, 0.0)), 0);
}

TEST(HuberWeight, FallsInverselyBeyondItsBound) {
  EXPECT_EQ(huber_weight(0, 2, 1.5), 1);
  EXPECT_EQ(huber_weight(3, 2, 1.5), 1);
  EXPECT_DOUBLE_EQ(huber_weight(-6, 2, 1.5), 0.5);
  EXPECT_DOUBLE_EQ(huber_weight(30, 2, 1.5), 0.1);
  EXPECT_EQ(huber_weight(1, 0, 1.5), 0);
}

}  // namespace
}  // namespace joulecast::statistics
