#include "dynamics/stribeck_curve.h"

#include <gtest/gtest.h>

#include <cmath>

namespace joulecast::dynamics {
namespace {

class StribeckCurve : public ::testing::TestWithParam<double> {};

TEST_P(StribeckCurve, IsExponentialAwayFromStandstill) {
  for (const double x : {0.2, 0.7, 1.5, 3.0}) {
    // The rounding moves |x|^d by d/2 of itself times rounding/x^2.
    const double power = std::pow(x, GetParam());
    const double off = power * GetParam() / 2 * stribeck_rounding / (x * x);
    EXPECT_NEAR(stribeck_curve(x, GetParam()), std::exp(-power), 1.01 * off * std::exp(-power)) << x;
    EXPECT_DOUBLE_EQ(stribeck_curve(-x, GetParam()), stribeck_curve(x, GetParam())) << x;
  }
}

TEST_P(StribeckCurve, SlopesMatchFiniteDifferences) {
  constexpr double h = 1e-5;
  for (const double x : {-0.6, 0.0, 0.02, 0.3, 1.0, 2.5}) {
    const auto at = [&](double y) { return stribeck_slopes(y, GetParam()); };
    EXPECT_DOUBLE_EQ(at(x).value, stribeck_curve(x, GetParam()));
    // Central differences err by h^2/6 times the third and fourth derivatives, which the rounding bounds.
    const double third = 3 / stribeck_rounding, fourth = 4 * std::pow(stribeck_rounding, -1.5);
    EXPECT_NEAR(at(x).first, (at(x + h).value - at(x - h).value) / (2 * h), h * h / 6 * third + 1e-9) << x;
    EXPECT_NEAR(at(x).second, (at(x + h).first - at(x - h).first) / (2 * h), h * h / 6 * fourth + 1e-9) << x;
  }
}

TEST_P(StribeckCurve, DifferentiatesByItsExponent) {
  constexpr double h = 1e-6;
  const double p = GetParam();
  for (const double x : {0.3, 1.0, 2.0}) {
    const Dual d = stribeck_curve(Dual(x), Dual(p, 1));
    EXPECT_NEAR(d.slope, (stribeck_curve(x, p + h) - stribeck_curve(x, p - h)) / (2 * h), 1e-8) << x;
  }
}

INSTANTIATE_TEST_SUITE_P(Exponents, StribeckCurve, ::testing::Values(1.0, 1.5, 2.0));

}  // namespace
}  // namespace joulecast::dynamics
