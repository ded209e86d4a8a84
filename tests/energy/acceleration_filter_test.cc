#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "energy/meter.h"

namespace joulecast::energy {
namespace {

TEST(AccelerationFilter, IsExactOnQuadratics) {
  const std::vector<double> times = {-0.1, -0.07, -0.031, 0, 0.02, 0.055, 0.09};
  std::vector<SpeedSample> window;
  for (double t : times) window.push_back({t, {1 + 2 * t - 3 * t * t, -4 + 0.5 * t + 7 * t * t}});
  const auto slope = fitted_acceleration(window, 3);
  EXPECT_NEAR(slope[0], 2, 1e-12);
  EXPECT_NEAR(slope[1], 0.5, 1e-12);
}

TEST(AccelerationFilter, FitsLineAtTheEnds) {
  const std::vector<SpeedSample> window = {{0, {1, 0}}, {0.02, {1.1, 0}}, {0.04, {1.2, 0}}};
  EXPECT_NEAR(fitted_acceleration(window, 0)[0], 5, 1e-12);
  EXPECT_NEAR(fitted_acceleration(window, 2)[0], 5, 1e-12);
  EXPECT_EQ(fitted_acceleration(std::span(window).first(1), 0)[0], 0);
}

// The bias that the header states: 3 (sin x - x cos x)/x^3.
TEST(AccelerationFilter, AttenuatesSinusoidsAsStated) {
  for (double frequency : {0.5, 1.0, 2.0}) {
    const double omega = 2 * std::numbers::pi * frequency;
    std::vector<SpeedSample> window;
    for (int k = -200; k <= 200; ++k) window.push_back({k * 0.0005, {std::sin(omega * k * 0.0005), 0}});
    const double x = omega * 0.1;
    const double expected = 3 * (std::sin(x) - x * std::cos(x)) / (x * x * x);
    EXPECT_NEAR(fitted_acceleration(window, 200)[0] / omega, expected, 0.01 * (1 - expected) + 1e-6)
        << frequency;
  }
}

}  // namespace
}  // namespace joulecast::energy
