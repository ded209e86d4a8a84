#include "plausibility/delays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "tests/plausibility/made_recordings.h"

namespace joulecast::plausibility {
namespace {

// A current that follows the motion after a delay, with noise, and a yaw rate without delay.
telemetry::Recording drive(double delay_s, double rate_hz, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  return made::mission(120, rate_hz, [&](double t, signals::Sample& s) {
    const made::Motion now = made::motion(t), then = made::motion(t - delay_s);
    s.wheel_velocity_rad_s = {now.speed[0] + 0.01 * normal(random), now.speed[1] + 0.01 * normal(random)};
    for (std::size_t k : {0u, 1u}) {
      s.motor_current_a[k] = 1 + 0.1 * then.speed[k] + 0.8 * then.slope[k] + 0.1 * normal(random);
    }
    s.yaw_rate_rad_s = 0.2 * (now.speed[0] - now.speed[1]) + 0.005 * normal(random);
  });
}

class AtRate : public ::testing::TestWithParam<double> {};

TEST_P(AtRate, FindsDelayBetweenRows) {
  for (const double delay : {0.0, 0.07, 0.21}) {
    const auto mission = drive(delay, GetParam(), 11);
    const Lags lags({&mission, 1});
    for (const Late current : {Late::current_right, Late::current_left}) {
      const auto found = lags.delay(current);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->value_s, delay, std::max(0.02, 0.4 / GetParam()));  // slow rows resolve less
      EXPECT_LE(found->interval[0], found->value_s);
      EXPECT_GE(found->interval[1], found->value_s);
      EXPECT_LT(found->interval[1] - found->interval[0], 0.08);
    }
    const auto gyro = lags.delay(Late::yaw_rate);
    ASSERT_TRUE(gyro);
    EXPECT_NEAR(gyro->value_s, 0, 0.005);
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, AtRate, ::testing::Values(10.0, 50.0, 200.0));

TEST(Delays, ReturnsNothingForUnrelatedCurrents) {
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  const auto recording = made::mission(120, 25, [&](double t, signals::Sample& s) {
    s.wheel_velocity_rad_s = made::motion(t).speed;
    s.motor_current_a = {normal(random), normal(random)};
  });
  const Lags lags({&recording, 1});
  EXPECT_FALSE(lags.delay(Late::current_right));
  EXPECT_FALSE(lags.delay(Late::battery_power));
}

}  // namespace
}  // namespace joulecast::plausibility
