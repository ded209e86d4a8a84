#include "forecast/drift.h"

#include <gtest/gtest.h>

#include "client/virtual_robot/rng.h"

namespace joulecast::forecast {
namespace {

using virtual_robot::Rng;

// Siegmund: the average run of a one-sided CUSUM of normal scores with slack k and limit b is
// (exp(2 k B) - 2 k B - 1) / (2 k^2), B = b + 1.166: 19,000 scores for k = 0.5, b = 8, half of it two-sided.
// In 20,000 scores two alarms are expected; more than eight have a probability below 3e-4.
TEST(DriftWatch, RarelyAlarmsWithoutDrift) {
  Rng rng(5);
  DriftWatch watch;
  int alarms = 0;
  for (int k = 0; k < 20'000; ++k) alarms += watch.add(rng.normal()) > 0;
  EXPECT_LE(alarms, 8);
}

// After a shift of two deviations the sum grows by 1.5 a mission, so that 8 is passed after about 6.
TEST(DriftWatch, DetectsShiftWithinTwelveMissions) {
  for (const double sign : {-1.0, 1.0}) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      Rng rng(seed);
      DriftWatch watch;
      for (int k = 0; k < 30; ++k) watch.add(0);
      std::int64_t since = 0;
      int missions = 0;
      while (since == 0 && missions < 12) since = watch.add(sign * 2 + 0.5 * rng.normal()), ++missions;
      EXPECT_GT(since, 0) << seed;
      EXPECT_LE(since, missions);
      EXPECT_GE(since, missions - 1);  // the change is put where it was
    }
  }
}

TEST(DriftWatch, OneOutlierIsNoDrift) {
  DriftWatch watch;
  EXPECT_EQ(watch.add(50), 0);
  EXPECT_EQ(watch.add(0), 0);
}

}  // namespace
}  // namespace joulecast::forecast
