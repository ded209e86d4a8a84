#include "statistics/updates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

namespace joulecast::statistics {
namespace {

constexpr double row_s = 0.02;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::vector<double> times(std::size_t n) {
  std::vector<double> t;
  for (std::size_t k = 0; k < n; ++k) t.push_back(row_s * static_cast<double>(k));
  return t;
}

// The values of a sensor that is read at rows `first`, `first + every`, ... in n rows of a table.
std::vector<double> held(std::size_t n, std::size_t first, std::size_t every,
                         const std::function<double(double)>& truth) {
  std::vector<double> values;
  double last = truth(-1);
  for (std::size_t k = 0; k < n; ++k) {
    if (k >= first && (k - first) % every == 0) last = truth(row_s * static_cast<double>(k));
    values.push_back(last);
  }
  return values;
}

double wave(double t) {
  return 10 * std::sin(1.3 * t) + 3 * std::sin(5.1 * t);
}

TEST(Updates, FindsReadingsInEachRow) {
  const auto t = times(300);
  const Updates u = find_updates(t, held(300, 0, 1, wave));
  EXPECT_FALSE(u.held);
  EXPECT_NEAR(u.period_s, row_s, 1e-12);
  ASSERT_EQ(u.at.size(), 300u);
  EXPECT_EQ(u.at[17], 17u);
}

TEST(Updates, FindsRowsOfHeldReadings) {
  for (const std::size_t every : {2u, 5u, 12u}) {
    const auto t = times(1000);
    const Updates u = find_updates(t, held(1000, 3, every, wave));
    EXPECT_TRUE(u.held);
    EXPECT_NEAR(u.period_s, row_s * static_cast<double>(every), 1e-12);
    ASSERT_EQ(u.at.size(), (1000 - 3 + every - 1) / every);
    for (std::size_t n = 0; n < u.at.size(); ++n) EXPECT_EQ(u.at[n], 3 + n * every);
  }
}

TEST(Updates, AcceptsEarlyAndLateRows) {
  // Readings every 6.4 rows, shown at the next row.
  const auto t = times(1500);
  std::vector<double> values;
  for (std::size_t k = 0; k < 1500; ++k)
    values.push_back(wave(0.128 * std::floor(static_cast<double>(k) / 6.4)));
  const Updates u = find_updates(t, values);
  EXPECT_TRUE(u.held);
  EXPECT_NEAR(u.period_s, 0.128, 0.5 * row_s);
  EXPECT_NEAR(static_cast<double>(u.at.size()), 1500 / 6.4, 1.5);
}

TEST(Updates, SteadyStateCountsEveryReading) {
  // Nothing changes from 8 s to 20 s.
  const auto t = times(1400);
  const auto truth = [](double at) { return wave(at < 8 ? at : at < 20 ? 8 : at - 12); };
  const Updates u = find_updates(t, held(1400, 0, 5, truth));
  EXPECT_TRUE(u.held);
  EXPECT_NEAR(u.period_s, 5 * row_s, 1e-12);
  // The first row may repeat a reading from before the table.
  ASSERT_EQ(u.at.size(), 279u);
  for (std::size_t n = 0; n < u.at.size(); ++n) EXPECT_EQ(u.at[n], 5 * (n + 1));
}

TEST(Updates, QuantizedChannelKeepsItsPeriod) {
  // Steps of one: many readings are equal.
  const auto t = times(3000);
  const auto values = held(3000, 0, 5, [](double at) { return std::round(wave(0.3 * at)); });
  const Updates u = find_updates(t, values);
  EXPECT_TRUE(u.held);
  EXPECT_NEAR(u.period_s, 5 * row_s, 1e-12);
  for (const std::size_t at : u.at) EXPECT_EQ(at % 5, 0u);
}

// In how many of 1000 tables of so many rows a channel made by `next` from its last value looks held.
int look_held(std::size_t rows, const std::function<double(double, std::mt19937_64&)>& next) {
  int count = 0;
  const auto t = times(rows);
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    std::mt19937_64 random(seed);
    std::vector<double> values{0};
    while (values.size() < rows) values.push_back(next(values.back(), random));
    count += find_updates(t, values).held ? 1 : 0;
  }
  return count;
}

TEST(Updates, CoarseConverterReadsEveryRow) {
  // Noise of some steps about a value: it repeats by chance.
  for (const double sd : {0.2, 0.35, 0.5, 1.0}) {
    for (const std::size_t rows : {150u, 1000u}) {
      std::normal_distribution<double> noise(0.2, sd);
      EXPECT_LE(look_held(rows, [&](double, std::mt19937_64& random) { return std::round(noise(random)); }),
                10)
          << sd << " " << rows;
    }
  }
}

TEST(Updates, DetectsSlowCoarseValues) {
  // A random walk in steps of one.
  for (const double stay : {0.3, 0.5, 0.7, 0.9}) {
    for (const std::size_t rows : {150u, 1000u}) {
      std::bernoulli_distribution stays(stay), up(0.5);
      const auto walk = [&](double last, std::mt19937_64& random) {
        return stays(random) ? last : last + (up(random) ? 1 : -1);
      };
      EXPECT_LE(look_held(rows, walk), 10) << stay << " " << rows;
    }
  }
}

TEST(Updates, SummedSensorsNeedBothReadings) {
  const auto t = times(1000);
  const auto one = held(1000, 0, 10, wave),
             other = held(1000, 2, 10, [](double at) { return wave(at + 40); });
  std::vector<double> sum;
  for (std::size_t k = 0; k < 1000; ++k) sum.push_back(one[k] + other[k]);
  const Updates u = find_updates(t, sum);
  EXPECT_TRUE(u.held);
  EXPECT_NEAR(u.period_s, 10 * row_s, 1e-12);
  ASSERT_EQ(u.at.size(), 100u);
  for (std::size_t n = 0; n < u.at.size(); ++n) EXPECT_EQ(u.at[n], 2 + 10 * n);
}

TEST(Updates, IgnoresRowsWithoutReading) {
  const auto t = times(200);
  std::vector<double> values(200, nan);
  for (std::size_t k = 4; k < 200; k += 10) values[k] = wave(t[k]);
  const Updates u = find_updates(t, values);
  EXPECT_NEAR(u.period_s, 10 * row_s, 1e-12);
  ASSERT_EQ(u.at.size(), 20u);
  EXPECT_EQ(u.at[0], 4u);
  EXPECT_EQ(u.at[19], 194u);
  // They last until the next one.
  EXPECT_TRUE(u.held);
}

TEST(Updates, ConstantChannelReadsEveryRow) {
  const auto t = times(100);
  std::vector<double> values(100, 24.0);
  EXPECT_EQ(find_updates(t, values).at.size(), 100u);
  EXPECT_FALSE(find_updates(t, values).held);
  for (std::size_t k = 50; k < 100; ++k) values[k] = 23;
  EXPECT_EQ(find_updates(t, values).at.size(), 100u);
}

TEST(Updates, HandlesFewValues) {
  EXPECT_TRUE(find_updates({}, {}).at.empty());
  const std::vector<double> t{0, 1}, one{nan, 3};
  const Updates u = find_updates(t, one);
  ASSERT_EQ(u.at.size(), 1u);
  EXPECT_EQ(u.at[0], 1u);
  EXPECT_EQ(u.period_s, 0);
  EXPECT_FALSE(u.held);
}

}  // namespace
}  // namespace joulecast::statistics
