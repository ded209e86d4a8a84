#include "energy/cvode.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace joulecast::energy {
namespace {

class Decay : public InitialValueProblem {
 public:
  double k = 1;
  void rate(double, std::span<const double> y, std::span<double> f) override { f[0] = -k * y[0]; }
  void weights(std::span<const double>, std::span<double> w) const override { w[0] = 1e8; }
};

TEST(Cvode, RestartsAndStopsExactly) {
  for (Method method : {Method::adams, Method::bdf}) {
    Decay decay;
    Cvode cvode(1, method, decay);
    cvode.state()[0] = 1;
    double t = 0;
    for (int step = 0; step < 10; ++step, t += 0.1) ASSERT_TRUE(cvode.advance(t, t + 0.1));
    EXPECT_NEAR(cvode.state()[0], std::exp(-1), 1e-6);
  }
}

TEST(Cvode, RefusesToGoBackwardsOrNowhere) {
  Decay decay;
  Cvode cvode(1, Method::adams, decay);
  EXPECT_FALSE(cvode.advance(1, 1));
  EXPECT_FALSE(cvode.advance(1, 0.5));
}

TEST(Cvode, RefusesNaNAtOnce) {
  Decay decay;
  decay.k = std::numeric_limits<double>::quiet_NaN();
  Cvode cvode(1, Method::adams, decay);
  cvode.state()[0] = 1;
  const Result<void> done = cvode.advance(0, 1);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().fault, Fault::internal);
  EXPECT_FALSE(done.error().message.empty());
  EXPECT_LE(cvode.evaluations(), 2);
}

}  // namespace
}  // namespace joulecast::energy
