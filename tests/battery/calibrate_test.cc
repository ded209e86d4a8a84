#include "battery/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "battery/discharge.h"
#include "robot/robot_file.h"
#include "simulated_tests.h"
#include "support.h"
#include "tests/support/shared_folder.h"

namespace joulecast::battery {
namespace {

TEST(Calibrate, RecoversTheSimulatedBattery) {
  robot::Battery true_battery = full_battery();
  true_battery.branches.resize(1);
  const Circuit truth(true_battery);
  std::vector<int> steps;
  const auto calibration =
      calibrate(identification(truth), {2.5, 0.2, [&](int step) { steps.push_back(step); }});
  ASSERT_TRUE(calibration) << describe(calibration.error());
  EXPECT_EQ(static_cast<int>(steps.size()), calibration->iterations);
  EXPECT_TRUE(std::ranges::is_sorted(steps));
  const robot::Battery& found = calibration->battery;
  EXPECT_TRUE(robot::parse_battery(robot::to_json_text(found)));
  // The slow test ends at the cut-off, a little before the true charge is gone.
  EXPECT_NEAR(found.capacity_ah * *found.ageing_factor, 2.25, 0.01 * 2.25);
  EXPECT_EQ(found.capacity_ah, 2.5);
  // The ohmic share is not separable from a fast branch; the resistance to a steady current is.
  const auto steady_ohm = [](const robot::Battery& battery) {
    double sum = battery.internal_resistance_ohm;
    for (const auto& branch : battery.branches) sum += branch.resistance_ohm;
    return sum;
  };
  EXPECT_NEAR(steady_ohm(found), steady_ohm(true_battery), 0.05 * steady_ohm(true_battery));
  EXPECT_EQ(found.reserve_fraction, 0.2);
  EXPECT_NEAR(*found.cutoff_voltage_v, 2.5, 0.01);
  // A discharge that was not used for the fit: its time to 0.5 %, its voltage to twice the error of 0.135 %
  // of the nominal voltage that the fit grants each row (its knots are not those of the truth).
  const Recording unseen = simulated(truth, "unseen", {3.1, 0.4, 1.7, 4.2}, 170, 10);
  for (const auto kind : {Load::Kind::current, Load::Kind::power}) {
    const auto prediction = predict(Circuit(found), unseen, kind);
    ASSERT_TRUE(prediction) << describe(prediction.error());
    EXPECT_LT(std::abs(prediction->time_error), 0.005);
    EXPECT_LT(prediction->voltage_rms_v, 2 * 0.00135 * 3.7);
  }
}

TEST(Calibrate, IgnoresRestsAndRecharge) {
  robot::Battery true_battery = full_battery();
  true_battery.branches.resize(1);
  const Circuit truth(true_battery);
  std::vector<Recording> plain = identification(truth), dressed = plain;
  Recording& slow = dressed[0];
  const auto row = [](Recording& r, std::size_t at, double time_s, double current_a, double voltage_v) {
    const auto i = static_cast<std::ptrdiff_t>(at);
    r.time_s.insert(r.time_s.begin() + i, time_s);
    r.current_a.insert(r.current_a.begin() + i, current_a);
    r.voltage_v.insert(r.voltage_v.begin() + i, voltage_v);
    r.temperature_c.insert(r.temperature_c.begin() + i, 25);
  };
  // A current sensor's zero is not exact.
  for (int k = 1; k <= 30; ++k) row(slow, 0, -60.0 * k, k % 2 ? 0 : -1e-3, truth.open_circuit_voltage_v(1));
  const double end_s = slow.time_s.back(), end_v = slow.voltage_v.back();
  for (int k = 1; k <= 30; ++k) row(slow, slow.size(), end_s + 60 * k, 0, end_v + 0.1);
  for (int k = 31; k <= 90; ++k) row(slow, slow.size(), end_s + 60 * k, -1, end_v + 0.3);
  const auto expected = calibrate(plain), found = calibrate(dressed);
  ASSERT_TRUE(found) << describe(found.error());
  EXPECT_NEAR(found->battery.capacity_ah, expected->battery.capacity_ah, 1e-9);
  EXPECT_NEAR(found->battery.internal_resistance_ohm, expected->battery.internal_resistance_ohm, 1e-6);

  for (double& current : dressed[1].current_a) current = -current;
  const auto reversed = calibrate(dressed);
  ASSERT_FALSE(reversed);
  EXPECT_NE(reversed.error().message.find("positive while"), std::string::npos);
}

TEST(Calibrate, AcceptsRowsWithoutTemperature) {
  const Circuit truth(full_battery());
  const std::vector<Recording> whole = identification(truth);
  std::vector<Recording> gappy = whole;
  for (Recording& recording : gappy)
    for (std::size_t row = 0; row < recording.size(); row += 7) recording.temperature_c[row] = std::nan("");
  const auto expected = calibrate(whole), found = calibrate(gappy);
  ASSERT_TRUE(expected && found);
  ASSERT_TRUE(expected->battery.thermal_resistance_k_w && found->battery.thermal_resistance_k_w);
  EXPECT_NEAR(*found->battery.thermal_resistance_k_w, *expected->battery.thermal_resistance_k_w,
              0.02 * *expected->battery.thermal_resistance_k_w);
}

// The slow lag of the truth is beyond the fit's range.
TEST(Calibrate, ReportsFitsAtBounds) {
  robot::Battery true_battery = full_battery();
  true_battery.charge_lags = {{70, 60}, {3000, 2000}};
  const auto found = calibrate(identification(Circuit(true_battery)));
  ASSERT_TRUE(found) << describe(found.error());
  const auto lag = std::ranges::find(found->at_bounds, "/charge_lags/1/lag_s", &AtBound::field);
  ASSERT_NE(lag, found->at_bounds.end());
  EXPECT_NEAR(lag->bound, 2000, 1e-6);
  EXPECT_EQ(lag->bound, found->battery.charge_lags[1].lag_s);
}

TEST(Calibrate, NamesTheMissingTest) {
  const Circuit truth(full_battery());
  const auto all = identification(truth);
  EXPECT_THAT(calibrate({all[1], all[2]}).error().message, ::testing::HasSubstr("without pause"));
  EXPECT_THAT(calibrate({all[0]}).error().message, ::testing::HasSubstr("besides the slow one"));
  EXPECT_FALSE(calibrate({}));
  Recording rest = all[1];
  std::fill(rest.current_a.begin(), rest.current_a.end(), 0.0);
  EXPECT_THAT(calibrate({all[0], rest}).error().message, ::testing::HasSubstr("half draws no charge"));
}

TEST(Calibrate, PassesOverUselessTests) {
  const Circuit truth(full_battery());
  const std::vector<Recording> plain = identification(truth);
  std::vector<Recording> more = plain;
  Recording recharge = plain[1], check = plain[1];
  recharge.name = "recharge";
  for (double& current : recharge.current_a) current = -current;
  std::ranges::reverse(recharge.voltage_v);
  check.name = "check";
  for (auto* column : {&check.time_s, &check.current_a, &check.voltage_v, &check.temperature_c})
    column->resize(5);
  more.insert(more.begin() + 1, {recharge, check});
  const auto expected = calibrate(plain), found = calibrate(more);
  ASSERT_TRUE(found) << describe(found.error());
  EXPECT_EQ(found->battery, expected->battery);
  ASSERT_EQ(found->passed_over.size(), 2u);
  EXPECT_EQ(found->passed_over[0].name, "recharge");
  EXPECT_EQ(found->passed_over[1].name, "check");
  ASSERT_EQ(found->recordings.size(), plain.size());
  for (std::size_t k = 0; k < plain.size(); ++k) EXPECT_EQ(found->recordings[k].name, plain[k].name);
}

// Recorded down to a lower voltage than the cut-off: the time to the cut-off counts, not the end of the
// recording.
TEST(Predict, EndsAtTheCutOff) {
  robot::Battery battery = full_battery();
  const Recording recording = simulated(Circuit(battery), "low", {2}, 120, 10);
  battery.cutoff_voltage_v = 3.3;
  const auto prediction = predict(Circuit(battery), recording, Load::Kind::current);
  ASSERT_TRUE(prediction) << describe(prediction.error());
  EXPECT_EQ(prediction->end_voltage_v, 3.3);
  EXPECT_LT(prediction->measured_s, 0.98 * recording.duration_s());
  EXPECT_NEAR(prediction->predicted_s, prediction->measured_s, 1);
}

TEST(Predict, PredictsItsOwnRecordings) {
  const Circuit truth(full_battery());
  const Recording recording = simulated(truth, "own", {2, 0, 4}, 120, 10);
  const auto prediction = predict(truth, recording, Load::Kind::current);
  ASSERT_TRUE(prediction) << describe(prediction.error());
  // The recording ends with the row after the crossing: within one row.
  EXPECT_NEAR(prediction->predicted_s, prediction->measured_s, 10);
  EXPECT_LT(prediction->voltage_rms_v, 1e-4);  // the recording's steps hold the heat for a second
  const PredictionSummary summary = summarise({*prediction, *prediction});
  EXPECT_EQ(summary.count, 2u);
  EXPECT_DOUBLE_EQ(summary.time_error_p95, std::abs(prediction->time_error));
}

// Identified on slow, pulse and constant-current tests of a real cell, the circuit predicts
// its random discharges, which the fit did not use.
class RealCell : public ::testing::TestWithParam<const char*> {};

TEST_P(RealCell, PredictsRandomDischarges) {
  const std::filesystem::path folder =
      std::filesystem::path(JOULECAST_SHARED) / "data/real/battery_dmegc18650";
  JOULECAST_NEED_SHARED(std::filesystem::exists(folder), "battery recordings");
  const std::string prefix = (folder / GetParam()).string();
  std::vector<Recording> recordings;
  const auto files = identification_files(prefix);
  ASSERT_TRUE(files);
  ASSERT_EQ(files->size(), 5u);
  for (const auto& file : *files) {
    auto read = read_recordings(file);
    ASSERT_TRUE(read) << describe(read.error());
    recordings.insert(recordings.end(), read->begin(), read->end());
  }
  const auto calibration = calibrate(recordings);
  ASSERT_TRUE(calibration) << describe(calibration.error());
  const Circuit circuit(calibration->battery);
  const auto discharges = read_recordings(prefix + "_rw.csv");
  ASSERT_TRUE(discharges) << describe(discharges.error());
  ASSERT_EQ(discharges->size(), 50u);
  for (const auto kind : {Load::Kind::current, Load::Kind::power}) {
    std::vector<Prediction> predictions;
    for (const Recording& recording : *discharges) {
      const auto prediction = predict(circuit, recording, kind);
      ASSERT_TRUE(prediction) << describe(prediction.error());
      predictions.push_back(*prediction);
    }
    const PredictionSummary summary = summarise(predictions);
    EXPECT_LE(summary.time_error_median, 0.015);
    EXPECT_LE(summary.time_error_p95, 0.04);
    EXPECT_LE(summary.voltage_rms_worst_v, 0.025);
  }
}

INSTANTIATE_TEST_SUITE_P(Cells, RealCell, ::testing::Values("R1", "R2", "R3"));

}  // namespace
}  // namespace joulecast::battery
