#include "telemetry/validation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "samples.h"
#include "signals/sample.h"

namespace joulecast::telemetry {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Each channel of the table with its location in a sample.
struct Channel {
  std::string_view field;
  double* (*place)(signals::Sample&);
};

const Channel channels[] = {
    {"wheel_velocity[0]", [](signals::Sample& s) { return &s.wheel_velocity_rad_s[0]; }},
    {"wheel_velocity[1]", [](signals::Sample& s) { return &s.wheel_velocity_rad_s[1]; }},
    {"motor_voltage[0]", [](signals::Sample& s) { return &s.motor_voltage_v[0]; }},
    {"motor_voltage[1]", [](signals::Sample& s) { return &s.motor_voltage_v[1]; }},
    {"motor_current[0]", [](signals::Sample& s) { return &s.motor_current_a[0]; }},
    {"motor_current[1]", [](signals::Sample& s) { return &s.motor_current_a[1]; }},
    {"battery_voltage", [](signals::Sample& s) { return &s.battery_voltage_v; }},
    {"battery_current", [](signals::Sample& s) { return &s.battery_current_a; }},
    {"velocity_command[0]", [](signals::Sample& s) { return &s.velocity_command[0]; }},
    {"velocity_command[1]", [](signals::Sample& s) { return &s.velocity_command[1]; }},
    {"yaw_rate", [](signals::Sample& s) { return &s.yaw_rate_rad_s; }},
    {"pitch", [](signals::Sample& s) { return &s.pitch_rad; }},
    {"pose[0]", [](signals::Sample& s) { return &s.pose[0]; }},
    {"pose[1]", [](signals::Sample& s) { return &s.pose[1]; }},
    {"pose[2]", [](signals::Sample& s) { return &s.pose[2]; }},
    {"motor_temperature[0]", [](signals::Sample& s) { return &s.motor_temperature_c[0]; }},
    {"motor_temperature[1]", [](signals::Sample& s) { return &s.motor_temperature_c[1]; }},
    {"payload_mass", [](signals::Sample& s) { return &s.payload_kg; }},
};

TEST(Plausibility, TableCoversEveryChannelOnce) {
  ASSERT_EQ(plausible_ranges().size(), std::size(channels));
  for (std::size_t i = 0; i < std::size(channels); ++i)
    EXPECT_EQ(plausible_ranges()[i].field, channels[i].field);
}

TEST(Plausibility, AcceptsOrdinaryAndMotionSamples) {
  EXPECT_FALSE(check_plausible(test::distinct_sample()));
  EXPECT_FALSE(check_plausible(signals::Sample{}));
}

TEST(Plausibility, ChecksRangeOfEachChannel) {
  for (std::size_t i = 0; i < std::size(channels); ++i) {
    const PlausibleRange& range = plausible_ranges()[i];
    for (const double edge : {range.low, range.high}) {
      signals::Sample s = test::distinct_sample();
      *channels[i].place(s) = edge;
      EXPECT_FALSE(check_plausible(s)) << range.field;
      *channels[i].place(s) = std::nextafter(edge, edge == range.low ? -infinity : infinity);
      const auto fault = check_plausible(s);
      ASSERT_TRUE(fault) << range.field;
      EXPECT_EQ(fault->why, Implausibility::out_of_range);
      EXPECT_EQ(fault->field, range.field);
      EXPECT_NE(describe(*fault).find(range.field), std::string::npos);
    }
  }
}

TEST(Plausibility, RejectsInfinityAndWheelNan) {
  for (std::size_t i = 0; i < std::size(channels); ++i) {
    for (const double bad : {infinity, -infinity}) {
      signals::Sample s = test::distinct_sample();
      *channels[i].place(s) = bad;
      const auto fault = check_plausible(s);
      ASSERT_TRUE(fault) << channels[i].field;
      EXPECT_EQ(fault->why, Implausibility::infinite);
      EXPECT_EQ(fault->field, channels[i].field);
    }
    signals::Sample s = test::distinct_sample();
    *channels[i].place(s) = signals::unmeasured;
    const auto fault = check_plausible(s);
    EXPECT_EQ(fault.has_value(), i < 2) << channels[i].field;
    if (fault) {
      EXPECT_EQ(fault->why, Implausibility::missing);
    }
  }
}

TEST(Plausibility, ChecksClockAndSequence) {
  signals::Sample s;
  s.utime_us = -1;
  EXPECT_EQ(check_plausible(s)->why, Implausibility::bad_clock);
  s.utime_us = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(check_plausible(s)->why, Implausibility::bad_clock);
  s.utime_us = 0;
  s.sequence = -1;
  EXPECT_EQ(check_plausible(s)->why, Implausibility::bad_sequence);
}

TEST(Plausibility, ChecksMissionEvents) {
  EXPECT_FALSE(check_plausible(
      signals::MissionEvent{0, "m", signals::MissionPhase::started, signals::unmeasured, ""}));
  EXPECT_EQ(check_plausible(signals::MissionEvent{-1, "m", signals::MissionPhase::started, 0, ""})->why,
            Implausibility::bad_clock);
  EXPECT_EQ(check_plausible(signals::MissionEvent{0, "m", signals::MissionPhase::started, -1, ""})->field,
            "payload_mass");
  EXPECT_EQ(check_plausible(signals::MissionEvent{0, "m", signals::MissionPhase::started, infinity, ""})->why,
            Implausibility::infinite);
}

}  // namespace
}  // namespace joulecast::telemetry
