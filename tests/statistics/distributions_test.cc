#include "statistics/distributions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace joulecast::statistics {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Abramowitz and Stegun, table 26.1; far out by Laplace's continued fraction (26.2.14) with 50 digits.
TEST(LogNormalCdf, AgreesWithTables) {
  EXPECT_DOUBLE_EQ(log_normal_cdf(0), std::log(0.5));
  EXPECT_NEAR(log_normal_cdf(1), std::log(0.841344746068543), 1e-14);
  EXPECT_NEAR(log_normal_cdf(-1), std::log(0.158655253931457), 1e-13);
  EXPECT_NEAR(log_normal_cdf(-5), -15.06499839398872, 1e-12);
  EXPECT_NEAR(log_normal_cdf(-10), -53.23128515051247, 1e-12);
  EXPECT_NEAR(log_normal_cdf(-29), -424.787419909730, 1e-11);
  EXPECT_NEAR(log_normal_cdf(-31), -484.853963627179, 1e-9);
  EXPECT_NEAR(log_normal_cdf(-40), -804.608442013754, 1e-9);
  EXPECT_NEAR(log_normal_cdf(-100), -5005.524208694205, 1e-9);
  // The complement to one keeps its digits.
  EXPECT_NEAR(log_normal_cdf(10) / -7.619853024160527e-24, 1, 1e-12);
}

TEST(LogNormalCdf, IsContinuousBetweenItsForms) {
  const double slope = 30 + 1 / 30.0;  // phi/Phi there
  EXPECT_NEAR(log_normal_cdf(-30 + 1e-6) - log_normal_cdf(-30 - 1e-6), 2e-6 * slope, 1e-9);
}

TEST(LogNormalWithin, IsTheMassBetweenBounds) {
  EXPECT_NEAR(log_normal_within(0, 1, -1, 1), std::log(0.682689492137086), 1e-13);
  EXPECT_NEAR(log_normal_within(3, 2, 1, 5), std::log(0.682689492137086), 1e-13);
  EXPECT_NEAR(log_normal_within(0, 1, 2, 3), std::log(0.0214002339165491), 1e-12);
  EXPECT_NEAR(log_normal_within(0, 1, -3, -2), std::log(0.0214002339165491), 1e-12);
  EXPECT_NEAR(log_normal_within(0, 1, 0, infinity), std::log(0.5), 1e-14);
  EXPECT_NEAR(log_normal_within(2, 2, -infinity, 0), std::log(0.158655253931457), 1e-13);
  EXPECT_EQ(log_normal_within(5, 1, -infinity, infinity), 0);
}

TEST(LogNormalWithin, KeepsPrecisionInTheTails) {
  // Beyond 41 lies e^-40 of what lies beyond 40.
  EXPECT_NEAR(log_normal_within(0, 1, 40, 41), log_normal_cdf(-40), 1e-9);
  EXPECT_NEAR(log_normal_within(0, 1, -41, -40), log_normal_cdf(-40), 1e-9);
}

TEST(NormalQuantile, AgreesWithTables) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540054, 1e-13);
  EXPECT_NEAR(normal_quantile(0.995), 2.575829303548901, 1e-13);
  EXPECT_NEAR(normal_quantile(0.025), -1.959963984540054, 1e-13);
  EXPECT_EQ(normal_quantile(0.5), 0);
}

// Abramowitz and Stegun, table 26.10.
TEST(StudentTQuantile, AgreesWithTables) {
  EXPECT_NEAR(student_t_quantile(0.975, 1), 12.706, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 10), 2.228, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.95, 30), 1.697, 5e-4);
  // With one degree it is Cauchy's, with two algebraic: t = (2p - 1)/sqrt(2p(1 - p)).
  EXPECT_NEAR(student_t_quantile(0.75, 1), 1, 1e-12);
  EXPECT_NEAR(student_t_quantile(0.9, 2), 0.8 / std::sqrt(0.18), 1e-12);
}

}  // namespace
}  // namespace joulecast::statistics
