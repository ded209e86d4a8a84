#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "gap/diagnose/recordings.h"
#include "plausibility/readings.h"
#include "tests/gap/diagnose/made_drives.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap {
namespace {

constexpr double rpm = 60 / (2 * std::numbers::pi);

// A robot with battery power alone, as it is and with wheels that are counted twice: what is expected of the
// second, and what is found. `change` is made to each sample of both: (sample, its index, counted twice).
template <class Change>
std::array<Result<Diagnosis>, 2> with_wheels_counted_twice(const Change& change) {
  const made::Robot robot = made::virtual_robot("amr", 21, [](virtual_robot::SimulationSpec& spec) {
    spec.sensors.motor_channels = false;
    spec.missions = 3;
  });
  const auto diagnosed = [&](bool twice) {
    telemetry::RecordingSet set = robot.recordings;
    for (telemetry::Recording& mission : set.missions)
      for (std::size_t k = 0; k < mission.samples.size(); ++k) {
        signals::Sample& s = mission.samples[k];
        for (double& w : s.wheel_velocity_rad_s) w *= twice ? 2 : 1;
        change(s, k, twice);
      }
    return diagnose(set, robot.model, {});
  };
  return {diagnosed(false), diagnosed(true)};
}

// With battery power as the only other reading.
TEST(Diagnose, CorrectsUnitShownByPower) {
  const auto [expected, found] = with_wheels_counted_twice([](signals::Sample& s, std::size_t, bool) {
    s.yaw_rate_rad_s = s.velocity_command[0] = s.velocity_command[1] = signals::unmeasured;
    s.pose.fill(signals::unmeasured);
  });
  ASSERT_TRUE(expected && found);
  EXPECT_NEAR(found->power_absolute_relative, expected->power_absolute_relative, 1e-9);
  EXPECT_EQ(found->verdict, expected->verdict);
  const auto check = std::ranges::find(found->checks, "wheel_velocity_scale", &Check::id);
  ASSERT_NE(check, found->checks.end());
  EXPECT_FALSE(check->contradicted);
  EXPECT_NE(check->says.find("divided by this factor, 2 (probability > 97\u00a0%"), std::string::npos)
      << check->says;
}

// With a factor that gyro and power confirm, recordings are diagnosed as without it; impossible readings are
// as if they had not been measured.
TEST(Diagnose, UsesConfirmedFactor) {
  const auto [expected, found] = with_wheels_counted_twice([](signals::Sample& s, std::size_t k, bool twice) {
    if (k % 50 > 2) return;
    s.battery_voltage_v = twice ? 65.535 : signals::unmeasured;
    s.battery_current_a = twice ? -0.01 : signals::unmeasured;
  });
  ASSERT_TRUE(expected && found);
  EXPECT_NEAR(found->power_absolute_relative, expected->power_absolute_relative, 1e-9);
  EXPECT_EQ(found->verdict, expected->verdict);
  const auto check = [&checks = found->checks](std::string_view id) {
    const auto at = std::ranges::find(checks, id, &Check::id);
    return at == checks.end() ? nullptr : &*at;
  };
  ASSERT_TRUE(check("wheel_velocity_scale") && check("impossible_readings"));
  EXPECT_NEAR(check("wheel_velocity_scale")->value, 2, 0.01);  // as measured; 2 is divided out
  EXPECT_FALSE(check("wheel_velocity_scale")->contradicted);
  EXPECT_NE(check("wheel_velocity_scale")->says.find("divided by this factor"), std::string::npos);
}

// A channel with a wrong sign, unit or side is corrected: recordings are diagnosed as if it had been sent
// right.
TEST(Diagnose, CorrectsSignsAndUnits) {
  const made::Robot robot =
      made::virtual_robot("amr", 21, [](virtual_robot::SimulationSpec& spec) { spec.missions = 3; });
  const auto expected = diagnose(robot.recordings, robot.model);
  ASSERT_TRUE(expected);
  struct Planted {
    const char* id;
    std::vector<std::size_t> readings;
    double factor;  // 0: the readings are exchanged
  };
  const double degrees = 180 / std::numbers::pi;
  for (const Planted& planted :
       {Planted{"battery_current_reversed", {plausibility::reading::battery_current}, -1},
        Planted{"yaw_rate_scale", {plausibility::reading::yaw_rate}, degrees},
        Planted{"wheel_velocity_scale", {0, 1}, rpm}, Planted{"wheel_velocity_reversed", {1}, -1},
        Planted{"motor_current_sides_swapped", {4, 5}, 0}}) {
    telemetry::RecordingSet wrong = robot.recordings;
    for (telemetry::Recording& mission : wrong.missions)
      for (signals::Sample& s : mission.samples) {
        const auto readings = signals::numbers_of(s);
        if (planted.factor == 0)
          std::swap(*readings[planted.readings[0]], *readings[planted.readings[1]]);
        else
          for (const std::size_t k : planted.readings) *readings[k] *= planted.factor;
      }
    const auto found = diagnose(wrong, robot.model);
    ASSERT_TRUE(found) << planted.id;
    const auto check = std::ranges::find(found->checks, planted.id, &Check::id);
    ASSERT_NE(check, found->checks.end()) << planted.id;
    EXPECT_EQ(check->swapped, planted.factor == 0) << check->says;
    if (planted.factor != 0) {
      EXPECT_NEAR(check->factor.value_or(0) / planted.factor, 1, 1e-9) << check->says;
    }
    // A factor that two readings confirm has no probability.
    EXPECT_TRUE(std::isnan(check->probability) || check->probability > 0.5) << check->says;
    EXPECT_FALSE(check->contradicted);
    EXPECT_NE(check->says.find("The diagnosis uses"), std::string::npos) << check->says;
    EXPECT_NEAR(found->power_absolute_relative, expected->power_absolute_relative, 1e-6) << planted.id;
    EXPECT_EQ(found->verdict, expected->verdict) << planted.id;
  }
}

}  // namespace
}  // namespace joulecast::gap
