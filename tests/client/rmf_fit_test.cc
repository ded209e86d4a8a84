#include "client/commands/rmf_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace joulecast::client {
namespace {

const RmfParameters known_fleet{.voltage = 25,
                                .capacity = 40,
                                .mass = 70,
                                .moment_of_inertia = 5,
                                .friction_coefficient = 0.05,
                                .ambient_power = 30};

// Missions of five drives whose energy is exactly that of known_fleet.
std::vector<std::vector<RmfDrive>> exact_missions(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(0.5, 2);
  std::vector<std::vector<RmfDrive>> missions(count, std::vector<RmfDrive>(5));
  for (auto& mission : missions)
    for (RmfDrive& d : mission) {
      d = {.duration_s = 20 * any(random),
           .distance_m = 10 * any(random),
           .turn_rad = any(random),
           .speeding = any(random),
           .swerving = any(random)};
      d.energy_j = 70 * d.speeding + 5 * d.swerving + 0.05 * 70 * 9.81 * d.distance_m + 30 * d.duration_s;
      d.charge_c = d.energy_j / 25;
    }
  return missions;
}

TEST(RmfFit, RecoversExactParameters) {
  const auto fit = fit_rmf(exact_missions(9), 40, RmfParameters{.charging_current = 12, .mass = 1});
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->parameters.mass, known_fleet.mass, 1e-6);
  EXPECT_NEAR(fit->parameters.moment_of_inertia, known_fleet.moment_of_inertia, 1e-6);
  EXPECT_NEAR(fit->parameters.friction_coefficient, known_fleet.friction_coefficient, 1e-9);
  EXPECT_NEAR(fit->parameters.ambient_power, known_fleet.ambient_power, 1e-6);
  EXPECT_NEAR(fit->parameters.voltage, known_fleet.voltage, 1e-9);
  EXPECT_EQ(fit->parameters.charging_current, 12);
  EXPECT_EQ(fit->held_out, 3U);
  EXPECT_NEAR(fit->error.absolute, 0, 1e-9);
  ASSERT_TRUE(fit->error_before);
  EXPECT_GT(fit->error_before->absolute, 0.9);
}

TEST(RmfFit, NeedsSixMissions) {
  EXPECT_FALSE(fit_rmf(exact_missions(5), 40, {}));
  EXPECT_TRUE(fit_rmf(exact_missions(6), 40, {}));
}

// Rests for 1 s, accelerates to 1 m/s within 2 s, cruises for 6 s, brakes within 2 s and rests for 5 s; then
// turns at 1 rad/s.
RmfTelemetry two_drives(double radius_m, double half_track_m) {
  RmfTelemetry t;
  for (int k = 0; k < 1400; ++k) {
    const double s = 0.02 * k - 1;
    const double speed = s < 0 ? 0 : s < 2 ? s / 2 : s < 8 ? 1 : s < 10 ? (10 - s) / 2 : 0;
    const double yaw_rate = s < 15 ? 0 : s < 16 ? s - 15 : s < 22 ? 1 : s < 23 ? 23 - s : 0;
    t.time_s.push_back(s + 1);
    t.wheel_rad_s[0].push_back((speed + half_track_m * yaw_rate) / radius_m);
    t.wheel_rad_s[1].push_back((speed - half_track_m * yaw_rate) / radius_m);
    t.voltage_v.push_back(25);
    t.current_a.push_back(2);
  }
  return t;
}

TEST(RmfFit, IntegratesEachDrive) {
  const auto drives = rmf_drives(two_drives(0.08, 0.22), 0.08, 0.22);
  ASSERT_EQ(drives.size(), 2U);
  EXPECT_NEAR(drives[0].distance_m, 8, 0.02);
  EXPECT_NEAR(drives[0].turn_rad, 0, 1e-9);
  EXPECT_NEAR(drives[0].speeding, 1, 1e-6);  // up and down: twice half the square of 1 m/s
  EXPECT_NEAR(drives[1].turn_rad, 7, 0.02);
  EXPECT_NEAR(drives[1].swerving, 1, 1e-6);
  EXPECT_NEAR(drives[0].energy_j + drives[1].energy_j, 28 * 50, 1e-6);
  EXPECT_NEAR(drives[0].duration_s, 16, 0.51);
}

TEST(RmfFit, OmitsDrivesWithoutBattery) {
  RmfTelemetry telemetry = two_drives(0.08, 0.22);
  telemetry.current_a[300] = std::numeric_limits<double>::quiet_NaN();
  const auto drives = rmf_drives(telemetry, 0.08, 0.22);
  ASSERT_EQ(drives.size(), 1U);
  EXPECT_NEAR(drives[0].turn_rad, 7, 0.02);
}

constexpr const char* configuration =
    "rmf_fleet:\n"
    "  battery_system:\n"
    "    voltage: 24.0 # V\n"
    "    capacity: 40.0\n"
    "    charging_current: 26.4 # A\n"
    "  mechanical_system: # of each robot\n"
    "    mass: 80.0\n"
    "    moment_of_inertia: 20.0 #kgm^2\n"
    "    friction_coefficient: 0.20\n"
    "  ambient_system:\n"
    "    power: 20.0\n"
    "  tool_system:\n"
    "    power: 10.0\r\n"
    "  other:\n"
    "    power: 7\n";

TEST(RmfConfiguration, ReadsAllValues) {
  const auto read = read_rmf_configuration(configuration);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->voltage, 24);
  EXPECT_EQ(read->charging_current, 26.4);
  EXPECT_EQ(read->friction_coefficient, 0.2);
  EXPECT_EQ(read->ambient_power, 20);
  EXPECT_EQ(read->tool_power, 10);
}

TEST(RmfConfiguration, ReplacesValuesOnly) {
  RmfParameters other = known_fleet;
  other.tool_power = 11;
  const std::string text = with_rmf_parameters(configuration, other);
  EXPECT_THAT(
      text, ::testing::HasSubstr("    voltage: 25 # V\n    capacity: 40\n    charging_current: 26.4 # A\n"));
  EXPECT_THAT(text, ::testing::HasSubstr("  mechanical_system: # of each robot\n    mass: 70\n"));
  EXPECT_THAT(text, ::testing::HasSubstr("    moment_of_inertia: 5 #kgm^2\n"));
  EXPECT_THAT(text, ::testing::HasSubstr("    power: 11\r\n  other:\n    power: 7\n"));
}

TEST(RmfConfiguration, NamesMissingValues) {
  std::string text = configuration;
  text.replace(text.find("mass: 80.0"), 10, "mass: x");
  EXPECT_EQ(describe(read_rmf_configuration(text).error()), "--config: x is not a number");
  text.replace(text.find("mass: x"), 7, "weight: 80");
  EXPECT_EQ(describe(read_rmf_configuration(text).error()),
            "--config: has no number mass on a line of its own below mechanical_system");
}

}  // namespace
}  // namespace joulecast::client
