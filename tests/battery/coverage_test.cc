#include "battery/coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "battery/discharge.h"
#include "simulated_tests.h"
#include "support.h"
#include "tests/support/shared_folder.h"

namespace joulecast::battery {
namespace {

Coverage covered(const std::vector<Recording>& recordings) {
  const auto calibration = calibrate(recordings);
  EXPECT_TRUE(calibration) << describe(calibration.error());
  const auto seen = coverage(recordings, *calibration);
  EXPECT_TRUE(seen) << describe(seen.error());
  return *seen;
}

robot::Battery cell() {
  robot::Battery battery = full_battery();
  battery.branches.resize(1);
  return battery;
}

TEST(BatteryCoverage, ReportsRatesAndFastestError) {
  const Circuit truth(cell());
  const Coverage seen = covered(identification(truth));
  // Rates are of the charge that the slow test drew, a little less than all.
  EXPECT_NEAR(seen.slow_rate_1_h, 0.05, 0.002);
  EXPECT_NEAR(seen.least_rate_1_h, 0.5, 0.01);
  EXPECT_NEAR(seen.most_rate_1_h, 2, 0.04);
  EXPECT_FALSE(seen.charging);
  ASSERT_TRUE(seen.fastest_left_out);
  EXPECT_EQ(seen.fastest_left_out->name, "two");
  EXPECT_NEAR(seen.fastest_left_out->seen_to_1_h, 1, 0.02);
  // The recordings follow the fitted circuit, so that the error is small.
  EXPECT_LT(std::fabs(seen.fastest_left_out->time_error), 0.03);
  EXPECT_THAT(sentences(seen), ::testing::Contains(::testing::HasSubstr("rates above 2 C were not tested")));
}

TEST(BatteryCoverage, OneRateHasNoComparison) {
  const Circuit truth(cell());
  const auto all = identification(truth);
  const Coverage seen = covered({all[0], all[1]});
  EXPECT_FALSE(seen.fastest_left_out);
  EXPECT_THAT(sentences(seen), ::testing::Contains(::testing::HasSubstr("Add a test at another rate")));
}

// The duration in the cold of a true battery with a usual activation lies between the stated bounds.
TEST(BatteryCoverage, ColdDurationLiesWithinBounds) {
  for (const double activation_k : {1200.0, 2500.0, 4500.0}) {
    robot::Battery battery = cell();
    battery.activation_k = activation_k;
    battery.thermal_resistance_k_w.reset();
    battery.thermal_time_constant_s.reset();
    const Circuit truth(battery);
    const Coverage seen = covered(identification(truth));
    ASSERT_EQ(seen.unseen_temperatures.size(), 2u);
    const Coverage::Temperature& cold = seen.unseen_temperatures[0];
    EXPECT_EQ(cold.temperature_c, 0);
    const double current_a = cold.rate_1_h * truth.capacity_ah();
    const auto lasts = [&](double temperature_c) {
      DischargeLimits limits;
      limits.ambient_c = temperature_c;
      const Load load{Load::Kind::current, {{7200 / cold.rate_1_h, current_a, current_a}}};
      return discharge(truth, Circuit::rested(1, temperature_c), load, limits).value().duration_s;
    };
    const double share = lasts(0) / lasts(25);
    EXPECT_GE(share, cold.least - 0.01) << activation_k;
    EXPECT_LE(share, cold.most + 0.01) << activation_k;
    // Without a change of temperature its effect is unknown, and this battery has none.
    EXPECT_NEAR(cold.by_this, 1, 0.001);
  }
}

TEST(BatteryCoverage, ReportsMissingTemperature) {
  const Circuit truth(cell());
  auto recordings = identification(truth);
  for (Recording& r : recordings) std::ranges::fill(r.temperature_c, std::nan(""));
  const Coverage seen = covered(recordings);
  EXPECT_FALSE(seen.temperature_c);
  EXPECT_THAT(sentences(seen), ::testing::Contains(::testing::HasSubstr("no temperature was measured")));
}

TEST(BatteryCoverage, CoversARealCell) {
  const std::filesystem::path folder =
      std::filesystem::path(JOULECAST_SHARED) / "data/real/battery_dmegc18650";
  JOULECAST_NEED_SHARED(std::filesystem::exists(folder), "battery recordings");
  std::vector<Recording> recordings;
  const auto files = identification_files((folder / "R1").string());
  ASSERT_TRUE(files) << describe(files.error());
  for (const auto& file : *files) {
    const auto read = read_recordings(file);
    ASSERT_TRUE(read) << describe(read.error());
    recordings.insert(recordings.end(), read->begin(), read->end());
  }
  const Coverage seen = covered(recordings);
  // 0.5, 1 and 2 C of the rated 2.6 Ah (measured: 2.75 Ah), at 25 °C and above, as the cells warm up.
  EXPECT_NEAR(seen.most_rate_1_h, 2 * 2.6 / 2.75, 0.05);
  ASSERT_TRUE(seen.temperature_c);
  EXPECT_NEAR(seen.temperature_c->first, 24, 2);
  ASSERT_TRUE(seen.fastest_left_out);
  EXPECT_NEAR(seen.fastest_left_out->seen_to_1_h, 2.6 / 2.75, 0.05);
  EXPECT_LT(std::fabs(seen.fastest_left_out->time_error), 0.04);
  ASSERT_EQ(seen.unseen_temperatures.size(), 2u);
  EXPECT_LT(seen.unseen_temperatures[0].least, 0.95);
}

}  // namespace
}  // namespace joulecast::battery
