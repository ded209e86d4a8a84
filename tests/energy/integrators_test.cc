#include "energy/integrators.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace joulecast::energy {
namespace {

class Decay : public InitialValueProblem {
 public:
  double k = 1;
  int evaluations = 0;
  void rate(double, std::span<const double> y, std::span<double> f) override {
    ++evaluations;
    f[0] = -k * y[0];
  }
  void weights(std::span<const double>, std::span<double> w) const override { w[0] = 1e8; }
};

TEST(Cvode, RestartsAndStopsExactly) {
  Decay decay;
  Cvode cvode(1, decay);
  cvode.state()[0] = 1;
  double t = 0;
  for (int step = 0; step < 10; ++step, t += 0.1) ASSERT_TRUE(cvode.advance(t, t + 0.1));
  EXPECT_NEAR(cvode.state()[0], std::exp(-1), 1e-6);
}

TEST(Cvode, RejectsNonIncreasingTime) {
  Decay decay;
  Cvode cvode(1, decay);
  EXPECT_FALSE(cvode.advance(1, 1));
  EXPECT_FALSE(cvode.advance(1, 0.5));
}

TEST(Cvode, RejectsNaN) {
  Decay decay;
  decay.k = std::numeric_limits<double>::quiet_NaN();
  Cvode cvode(1, decay);
  cvode.state()[0] = 1;
  const auto done = cvode.advance(0, 1);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().fault, Fault::internal);
  EXPECT_FALSE(done.error().message.empty());
  EXPECT_LE(decay.evaluations, 2);
}

// y0' = -k y0; y1' = |t - 0.9|, with a kink that the ends and the middle of [0, 1] do not show; and an
// integral of t^2 and of y1.
class Problem : public InitialValueProblem {
 public:
  double k = 1, tolerance = 1e-8;
  int evaluations = 0;
  void rate(double t, std::span<const double> y, std::span<double> f) override {
    ++evaluations;
    f[0] = -k * y[0];
    f[1] = std::fabs(t - 0.9);
    f[2] = t * t;
    f[3] = y[1];
  }
  void weights(std::span<const double>, std::span<double> w) const override { w[0] = w[1] = 1 / tolerance; }
};

TEST(Erk, RestartsAndStopsExactly) {
  Problem problem;
  Erk erk(2, 2, problem);
  erk.state()[0] = 1;
  for (int step = 0; step < 10; ++step) ASSERT_TRUE(erk.advance(0.1 * step, 0.1 * (step + 1)));
  EXPECT_NEAR(erk.state()[0], std::exp(-1), 1e-6);
}

TEST(Erk, SmoothIntervalTakesOneStep) {
  Problem problem;
  problem.tolerance = 1;
  Erk erk(2, 2, problem);
  ASSERT_TRUE(erk.advance(0, 0.5));
  EXPECT_EQ(problem.evaluations, 4);
  EXPECT_NEAR(erk.state()[1], 0.5 * 0.9 - 0.125, 1e-15);  // order 3: exact for a line
  EXPECT_NEAR(erk.integrals()[0], 0.125 / 3, 1e-15);      // and for a parabola
}

TEST(Erk, ResolvesKinksOfTheRate) {
  Problem problem;
  Erk erk(2, 2, problem);
  ASSERT_TRUE(erk.advance(0, 1));
  EXPECT_NEAR(erk.state()[1], 0.41, 1e-6);
  EXPECT_NEAR(erk.integrals()[0], 1.0 / 3, 1e-15);
  // y1 = (0.81 - (0.9 - t)^2)/2 up to 0.9, 0.405 + (t - 0.9)^2/2 behind.
  EXPECT_NEAR(erk.integrals()[1], 0.405 * 0.9 - 0.729 / 6 + 0.0405 + 0.001 / 6, 1e-6);
  EXPECT_GT(problem.evaluations, 10);
}

TEST(Erk, RejectsNonIncreasingTime) {
  Problem problem;
  Erk erk(2, 2, problem);
  EXPECT_FALSE(erk.advance(1, 1));
  EXPECT_FALSE(erk.advance(1, 0.5));
}

TEST(Erk, RejectsNaN) {
  Problem problem;
  problem.k = std::numeric_limits<double>::quiet_NaN();
  Erk erk(2, 2, problem);
  erk.state()[0] = 1;
  const Result<void> done = erk.advance(0, 1);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().fault, Fault::internal);
  EXPECT_FALSE(done.error().message.empty());
  EXPECT_LE(problem.evaluations, 2);
}

}  // namespace
}  // namespace joulecast::energy
