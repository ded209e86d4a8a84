#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/virtual_robot/fleet.h"
#include "gap/diagnose/recordings.h"
#include "gap/verdict/diagnosis_json.h"
#include "robot/robot_file.h"
#include "telemetry/log_recordings.h"

namespace joulecast::gap {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

robot::RobotModel shipped() {
  return *robot::parse_robot(virtual_robot::shipped_robots()[0].json_text);
}

Result<Diagnosis> diagnose_shipped(const telemetry::RecordingSet& set) {
  return diagnose(set, shipped());
}

// A robot that rolls at constant speed, with battery readings if `power`.
telemetry::Recording rolling(double duration_s, bool power) {
  telemetry::Recording r;
  for (int k = 0; 0.02 * k < duration_s; ++k) {
    signals::Sample s;
    s.utime_us = 20'000 * k;
    s.wheel_velocity_rad_s = {3, 3};
    if (power) {
      s.battery_voltage_v = 24;
      s.battery_current_a = 2;
    }
    r.samples.push_back(s);
  }
  return r;
}

TEST(FewData, IsInconclusiveAndSuggestsDrive) {
  const auto set = telemetry::make_recording_set("r", {rolling(6, true)});
  ASSERT_TRUE(set);
  const auto d = diagnose_shipped(*set);
  ASSERT_TRUE(d);
  EXPECT_EQ(d->verdict, Verdict::inconclusive);
  EXPECT_TRUE(d->effects.empty());
  EXPECT_FALSE(d->next_drive.empty());
  const auto json = diagnosis_to_json(*d);
  EXPECT_TRUE(json["gap"]["power_absolute_relative"].is_null());
  EXPECT_EQ(json["verdict"], "inconclusive");
}

TEST(FewData, NamesNothingWithoutElectricalReadings) {
  const auto set = telemetry::make_recording_set("r", {rolling(60, false)});
  ASSERT_TRUE(set);
  const auto d = diagnose_shipped(*set);
  ASSERT_TRUE(d);
  EXPECT_EQ(d->verdict, Verdict::inconclusive);
  EXPECT_TRUE(d->effects.empty());
  EXPECT_FALSE(d->motor_channels);
  EXPECT_TRUE(d->next_drive.empty());
  EXPECT_THAT(d->reasons, ElementsAre(HasSubstr("needs battery_voltage with battery_current")));
}

TEST(FewData, NamesReadingsOfAnotherPack) {
  telemetry::Recording r = rolling(60, true);
  for (auto& s : r.samples) s.battery_voltage_v = 65.535;
  const auto set = telemetry::make_recording_set("r", {r});
  ASSERT_TRUE(set);
  const auto d = diagnose_shipped(*set);
  ASSERT_TRUE(d);
  EXPECT_EQ(d->verdict, Verdict::inconclusive);
  EXPECT_TRUE(d->next_drive.empty());
  EXPECT_THAT(d->reasons,
              ElementsAre(HasSubstr("without the readings of battery_voltage, which the checks")));
}

// Voltages show no load of the battery of any size.
TEST(FewData, StatesNoImpossibleLimit) {
  telemetry::Recording r = rolling(60, false);
  for (std::size_t k = 0; k < r.samples.size(); ++k) {
    const double phase = 0.02 * static_cast<double>(k);
    r.samples[k].wheel_velocity_rad_s = {9 + 6 * std::sin(3 * phase), 9 + 6 * std::sin(3 * phase)};
    const double voltage_v = std::fmod(phase, 0.6) < 0.3 ? 4 : -4;
    r.samples[k].motor_voltage_v = {voltage_v, voltage_v};
  }
  const auto set = telemetry::make_recording_set("r", {r});
  ASSERT_TRUE(set);
  const auto d = diagnose_shipped(*set);
  ASSERT_TRUE(d);
  EXPECT_EQ(d->verdict, Verdict::inconclusive);
  EXPECT_FALSE(d->detectable_share <= 1);
  ASSERT_FALSE(d->reasons.empty());
  EXPECT_THAT(d->reasons.front(), ::testing::HasSubstr("the voltages of the motors alone"));
  for (const std::string& reason : d->reasons) EXPECT_LT(reason.size(), 120u) << reason;
}

TEST(FewData, RejectsShortMission) {
  const auto set = telemetry::make_recording_set("r", {rolling(3, true)});
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().fault, Fault::invalid);
}

TEST(FewData, NamesLoadsOnlyAtStandstill) {
  telemetry::Recording r = rolling(60, true);
  for (auto& s : r.samples) s.wheel_velocity_rad_s = {0, 0};
  const auto set = telemetry::make_recording_set("r", {r});
  ASSERT_TRUE(set);
  const auto d = diagnose_shipped(*set);
  ASSERT_TRUE(d);
  for (const DiagnosedEffect& e : d->effects) {
    // A standstill shows constant loads only.
    EXPECT_TRUE(e.id == "accessory_load" || e.id == "current_sensor_bias" || e.id == "voltage_sensor_gain" ||
                e.id == "current_sensor_gain")
        << e.id;
  }
}

}  // namespace
}  // namespace joulecast::gap
