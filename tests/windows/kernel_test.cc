#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "windows/track.h"

namespace joulecast::windows {
namespace {

constexpr double length_s = 0.4;

std::vector<double> even_times(std::size_t n, double step_s) {
  std::vector<double> t;
  for (std::size_t k = 0; k < n; ++k) t.push_back(step_s * static_cast<double>(k));
  return t;
}

std::vector<double> of(const std::vector<double>& t, const std::function<double(double)>& f) {
  std::vector<double> v;
  for (const double at : t) v.push_back(f(at));
  return v;
}

// Mean of the raised cosine's square distance from its middle: L^2 (1/12 - 1/(2 pi^2)).
double second_moment(double length) {
  return length * length * (1.0 / 12 - 1 / (2 * std::numbers::pi * std::numbers::pi));
}

TEST(Kernel, MeansAndSlopesOfPolynomials) {
  const auto t = even_times(201, 0.01);
  const Kernel kernel(t, 80, 121, 1, length_s);
  EXPECT_NEAR(kernel.mean(of(t, [](double) { return -7.0; })), -7, 1e-12);
  EXPECT_NEAR(kernel.slope(of(t, [](double) { return -7.0; })), 0, 1e-12);
  const auto line = of(t, [](double at) { return 3 + 5 * at; });
  EXPECT_NEAR(kernel.mean(line), 8, 1e-12);
  EXPECT_NEAR(kernel.slope(line), 5, 1e-12);
  const auto square = of(t, [](double at) { return 4 * (at - 1) * (at - 1); });
  EXPECT_NEAR(kernel.mean(square), 4 * second_moment(length_s), 1e-6);
  EXPECT_NEAR(kernel.slope(square), 0, 1e-12);
  // The slope of a parabola is the one at the window's middle.
  EXPECT_NEAR(kernel.slope(of(t, [](double at) { return at * at; })), 2, 1e-12);
}

// -integral of phi' v = mean of v' under phi, for any v.
TEST(Kernel, SlopeIsMeanDerivative) {
  const auto t = even_times(2001, 0.001);
  const Kernel kernel(t, 800, 1201, 1, length_s);
  const auto v = of(t, [](double at) { return std::sin(9 * at); });
  const auto derivative = of(t, [](double at) { return 9 * std::cos(9 * at); });
  EXPECT_NEAR(kernel.slope(v), kernel.mean(derivative), 1e-4);
}

TEST(Kernel, IsExactOnUnevenLines) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> step(0.002, 0.05);
  std::vector<double> t{0};
  while (t.back() < 3) t.push_back(t.back() + step(random));
  for (double centre = 0.3; centre < 2.5; centre += 0.1) {
    std::size_t first = 0, last = 0;
    while (t[first] < centre - length_s / 2) ++first;
    while (t[last] <= centre + length_s / 2) ++last;
    const Kernel kernel(t, first, last, centre, length_s);
    EXPECT_NEAR(kernel.mean(std::vector<double>(t.size(), 2.5)), 2.5, 1e-12);
    EXPECT_NEAR(kernel.slope(std::vector<double>(t.size(), 2.5)), 0, 1e-10);
    const auto line = of(t, [&](double at) { return 6 - 4 * (at - centre); });
    EXPECT_NEAR(kernel.slope(line), -4, 1e-10);
    EXPECT_NEAR(kernel.mean(line), 6, 0.15);
  }
}

TEST(Kernel, PartsAreThirds) {
  const auto t = even_times(2001, 0.001);
  const Kernel kernel(t, 800, 1201, 1, length_s);
  // The outer thirds of a raised cosine contain 1/3 - sin(pi/3)/(2 pi) * ... each: integrals of 1 + cos.
  const double middle = 1.0 / 3 + std::sin(std::numbers::pi / 3) / std::numbers::pi;
  EXPECT_NEAR(kernel.part_weight()[1], middle, 2e-3);
  EXPECT_NEAR(kernel.part_weight()[0], 0.5 * (1 - middle), 2e-3);
  EXPECT_NEAR(kernel.part_weight()[2], 0.5 * (1 - middle), 2e-3);
  const auto v = of(t, [](double at) { return std::exp(at); });
  double mean = 0;
  for (std::size_t part = 0; part < Kernel::parts; ++part)
    mean += kernel.part_weight()[part] * kernel.mean_of_part(part, v);
  EXPECT_NEAR(mean, kernel.mean(v), 1e-12);
  // A step in the middle third does not appear in the outer ones.
  const auto step = of(t, [](double at) { return at < 1 ? 0.0 : 1.0; });
  EXPECT_EQ(kernel.mean_of_part(0, step), 0);
  EXPECT_EQ(kernel.mean_of_part(2, step), 1);
  EXPECT_NEAR(kernel.mean_of_part(1, step), 0.5, 0.01);
}

TEST(Kernel, EmptyPartHasNoWeight) {
  const std::vector<double> t{0, 0.01, 0.02, 0.9, 1, 1.1, 1.2, 2};
  // Samples of the window about 1.05: its begin and its middle.
  const Kernel kernel(t, 3, 6, 1.05, length_s);
  EXPECT_EQ(kernel.part_weight()[2], 0);
  EXPECT_EQ(kernel.mean_of_part(2, std::vector<double>(8, 5.0)), 0);
  EXPECT_NEAR(kernel.part_weight()[0] + kernel.part_weight()[1], 1, 1e-12);
}

}  // namespace
}  // namespace joulecast::windows
