#include "plausibility/tally.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "statistics/updates.h"

namespace joulecast::plausibility {
namespace {

// A random walk read every `hold` rows and rounded to `step` unless that is 0.
std::vector<double> read_every(std::size_t hold, double step, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  double value = 0, reading = 0;
  for (std::size_t k = 0; k < 3000; ++k) {
    value += 0.1 * normal(random);
    if (k % hold == 0) reading = step > 0 ? step * std::round(value / step) : value;
    values.push_back(reading);
  }
  return values;
}

ValueTally tally_of(const std::vector<double>& values) {
  ValueTally tally;
  for (const double v : values) tally.add(v);
  return tally;
}

TEST(ValueTally, CountsHeldReadings) {
  for (const std::size_t hold : {1u, 2u, 5u, 20u}) {
    for (const double step : {0.0, 0.3}) {
      const auto values = read_every(hold, step, 3 + hold);
      std::vector<double> time;
      for (std::size_t k = 0; k < values.size(); ++k) time.push_back(0.05 * static_cast<double>(k));
      const auto updates = statistics::find_updates(time, values);
      ASSERT_NEAR(updates.period_s, 0.05 * static_cast<double>(hold), 1e-9) << step;
      const std::size_t rows = tally_of(values).held_rows();
      // With coarse steps, readings also repeat by chance. The bounded memory may then not contain the hold
      // time, and each row counts as a reading.
      EXPECT_TRUE(rows == hold || (step > 0 && rows == 1)) << hold << " " << step << " " << rows;
    }
  }
}

TEST(ValueTally, MeasuresQuantisationStep) {
  EXPECT_NEAR(tally_of(read_every(1, 0.3, 5)).quantum(), 0.3, 1e-9);
  EXPECT_EQ(tally_of(read_every(1, 0, 5)).quantum(), 0);
}

TEST(ValueTally, MatchesTallyOfParts) {
  const auto values = read_every(1, 0.01, 6);
  const ValueTally whole = tally_of(values);
  ValueTally parts = tally_of({values.begin(), values.begin() + 1000});
  parts.append(ValueTally{});
  parts.append(tally_of({values.begin() + 1000, values.end()}));
  EXPECT_EQ(parts.known(), whole.known());
  EXPECT_EQ(parts.low(), whole.low());
  EXPECT_EQ(parts.high(), whole.high());
  EXPECT_NEAR(parts.mean(), whole.mean(), 1e-9);
  EXPECT_NEAR(parts.deviation(), whole.deviation(), 1e-9);
  EXPECT_EQ(parts.levels(), whole.levels());
}

TEST(ValueTally, CountsSpikesOfLargeValues) {
  std::vector<double> values;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0, 0.01);
  for (int k = 0; k < 1000; ++k) values.push_back((k < 500 ? 0.0 : 5.0) + normal(random));
  EXPECT_EQ(tally_of(values).spikes(), 0u);
  for (const std::size_t at : {600u, 700u, 801u}) values[at] = 0;
  EXPECT_EQ(tally_of(values).spikes(), 3u);
}

TEST(ValueTally, CountsRowsAtExtremes) {
  std::vector<double> values;
  for (int k = 0; k < 1000; ++k) values.push_back(std::min(3 * std::sin(0.05 * k), 2.0));
  const auto extreme = tally_of(values).extreme();
  EXPECT_EQ(extreme.value, 2);
  EXPECT_EQ(extreme.runs, 8u);
  EXPECT_GT(extreme.rows, 200u);
}

TEST(ValueTally, AcceptsSlowSensor) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  ValueTally slow, absent;
  for (int k = 0; k < 1000; ++k) {
    slow.add(k % 10 == 0 ? k : nan);
    absent.add(k < 100 ? k : nan);
  }
  EXPECT_EQ(slow.lost(), 0u);
  EXPECT_EQ(absent.lost(), 900u);
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

}  // namespace
}  // namespace joulecast::plausibility
