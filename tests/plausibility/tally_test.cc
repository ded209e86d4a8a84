#include "plausibility/tally.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace joulecast::plausibility {
namespace {

ValueTally tally_of(const std::vector<double>& values) {
  ValueTally tally;
  for (const double v : values) tally.add(v);
  return tally;
}

TEST(ValueTally, MatchesTallyOfParts) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  std::vector<double> values(3000);
  for (double& value : values) value = normal(random);
  const ValueTally whole = tally_of(values);
  ValueTally parts = tally_of({values.begin(), values.begin() + 1000});
  parts.append(ValueTally{});
  parts.append(tally_of({values.begin() + 1000, values.end()}));
  EXPECT_EQ(parts.known(), whole.known());
  EXPECT_EQ(parts.low(), whole.low());
  EXPECT_EQ(parts.high(), whole.high());
  EXPECT_NEAR(parts.mean(), whole.mean(), 1e-9);
  EXPECT_NEAR(parts.deviation(), whole.deviation(), 1e-9);
}

TEST(ClockTally, MeasuresPeriodGapsAndDisorder) {
  ClockTally clock;
  std::int64_t t = 0;
  for (std::int64_t k = 0; k < 1000; ++k) {
    t += k == 500 ? 3'000'000 : 20'000;
    clock.add(t, k);
    if (k == 700) clock.add(t, k);
    if (k == 800) clock.add(t - 1000, k);
  }
  EXPECT_NEAR(clock.period_s(), 0.02, 1e-3);
  EXPECT_EQ(clock.gaps().count, 1u);
  EXPECT_NEAR(clock.gaps().seconds, 3, 1e-6);
  EXPECT_EQ(clock.repeated(), 1u);
  EXPECT_EQ(clock.backward(), 1u);
  EXPECT_EQ(clock.disordered(), 2u);
  EXPECT_NEAR(clock.length_s(), 999 * 0.02 + 2.98, 0.03);
}

TEST(ClockTally, IgnoresStepsOfHeldReadings) {
  ClockTally clock;
  for (std::int64_t k = 0; k < 200; ++k) {
    if (k > 0) clock.add(500'000 * k - 100, 2 * k);
    clock.add(500'000 * k, 2 * k + 1);
  }
  EXPECT_NEAR(clock.period_s(), 0.5, 1e-3);
}

TEST(ClockTally, PeriodOmitsWayBackFromForeignTimes) {
  ClockTally clock;
  for (std::int64_t k = 0; k < 200; ++k)
    clock.add((k == 100 ? 1'000'000'000 : 1'000'000'000'000'000) + 20'000 * k, k);
  EXPECT_NEAR(clock.period_s(), 0.02, 1e-4);
}

}  // namespace
}  // namespace joulecast::plausibility
