#include "tests/study/trial/foreign/foreign_plant.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "telemetry/log_recordings.h"
#include "tests/study/trial/foreign/foreign_case.h"

namespace joulecast::trial::foreign {
namespace {

// Up to constant wheel speeds within 2 s, then held for 10 s.
Drive steady_drive(double right_rad_s, double left_rad_s, double payload_kg) {
  Drive drive;
  drive.payload_kg = payload_kg;
  for (int k = 0; k < 1200; ++k) {
    const double share = std::min(1.0, k / 200.0);
    drive.wheel_rad_s.push_back({share * right_rad_s, share * left_rad_s});
  }
  return drive;
}

// Battery power at a current and a voltage of both motors: (V - R i) i = P.
double battery_current(const ForeignRobot& r, double power_w) {
  return (r.battery_v - std::sqrt(r.battery_v * r.battery_v - 4 * r.battery_ohm * power_w)) /
         (2 * r.battery_ohm);
}

TEST(ForeignPlant, MatchesClosedFormSteadyState) {
  const ForeignRobot r;
  Departures with;
  with.coulomb_ratio = 0.4;
  with.viscous_ratio = 2;
  with.payload_rolling = 0.02;
  with.drag_n_s2_m2 = 20;
  with.gear_loss = 0.15;
  with.resistance_ratio = 0.5;
  with.brush_v = 0.8;
  with.accessory_w = 12;
  with.driver_loss = 0.1;
  const double wheel = 8, payload = 25, speed = wheel * r.radius_m;
  const ForeignState last = driven(r, with, steady_drive(wheel, wheel, payload), 0.1).back();
  const double own_nm = r.friction_nm[0] * 1.4 + r.viscous_nm_s_rad * 3 * wheel;
  const double passed_nm = r.radius_m / 2 * (0.02 * payload * 9.80665 + 20 * speed * speed);
  // The rolling resistance of the payload acts behind the gear, as the drag does.
  const double current = (own_nm + 1.15 * passed_nm) / r.constant_nm_a;
  const double voltage = r.resistance_ohm * 1.5 * current + r.constant_nm_a * wheel + 0.8;
  const double power = r.idle_w + 12 + 1.1 * 2 * voltage * current;
  for (std::size_t k : {0u, 1u}) {
    EXPECT_NEAR(last.wheel_rad_s[k], wheel, 1e-3);
    EXPECT_NEAR(last.current_a[k], current, 1e-3 * current);
    EXPECT_NEAR(last.voltage_v[k], voltage, 1e-3 * voltage);
  }
  EXPECT_NEAR(last.battery_power_w, power, 2e-3 * power);
  EXPECT_NEAR(last.battery_current_a, battery_current(r, power), 3e-3 * last.battery_current_a);
  EXPECT_NEAR(last.battery_voltage_v, r.battery_v - r.battery_ohm * last.battery_current_a, 1e-12);
}

TEST(ForeignPlant, LoadsBothWheelsByScrub) {
  const ForeignRobot r;
  Departures with;
  with.scrub = 0.3;
  const double wheel = 3;
  const ForeignState last = driven(r, with, steady_drive(wheel, -wheel, 0), 0.1).back();
  const double weight_n = (r.chassis_kg + 2 * r.wheel_kg) * 9.80665;
  const double moment_nm = 0.3 * weight_n * r.half_track_m / 2;
  const double wheel_nm =
      moment_nm * r.radius_m / (2 * r.half_track_m) + r.friction_nm[0] + r.viscous_nm_s_rad * wheel;
  EXPECT_NEAR(last.yaw_rate_rad_s, wheel * r.radius_m / r.half_track_m, 1e-3);
  EXPECT_NEAR(last.torque_nm[0], wheel_nm, 2e-3 * wheel_nm);
  EXPECT_NEAR(last.torque_nm[1], -wheel_nm, 2e-3 * wheel_nm);
}

TEST(ForeignPlant, AcceleratesTotalInertia) {
  ForeignRobot r;
  r.friction_nm = {1e-6, 1e-6};
  r.viscous_nm_s_rad = 0;
  Drive drive;
  const double rate_rad_s2 = 2;
  for (int k = 0; k < 500; ++k) drive.wheel_rad_s.push_back({0.01 * rate_rad_s2 * k, 0.01 * rate_rad_s2 * k});
  // The voltage is held for a controller period, in which the current falls. The mean current accelerates.
  const auto states = driven(r, {}, drive, 0.001);
  double mean_nm = 0;
  for (std::size_t k = 0; k < 1000; ++k) mean_nm += states[states.size() - 1 - k].torque_nm[0] / 1000;
  const double mass_kg = r.chassis_kg + 2 * r.wheel_kg;
  const double torque_nm = rate_rad_s2 * (mass_kg * r.radius_m * r.radius_m / 2 + r.wheel_inertia_kg_m2);
  EXPECT_NEAR(mean_nm, torque_nm, 0.005 * torque_nm);
}

TEST(ForeignPlant, ConvergesInStepSize) {
  virtual_robot::Rng rng(3);
  const ForeignRobot r;
  const Drive drive = draw_drive(r, 20, rng);
  const auto coarse = driven(r, {}, drive, 0.1), fine = driven(r, {}, drive, 0.1, 1.25e-4);
  ASSERT_EQ(coarse.size(), fine.size());
  double difference_w = 0, total_w = 0;
  for (std::size_t k = 0; k < fine.size(); ++k) {
    difference_w += std::fabs(coarse[k].battery_power_w - fine[k].battery_power_w);
    total_w += std::fabs(fine[k].battery_power_w);
  }
  EXPECT_LT(difference_w, 1e-3 * total_w);
}

TEST(ForeignPlant, SwitchesLoadForSixSeconds) {
  Departures with;
  with.switched_w = 50;
  Drive rest;
  rest.wheel_rad_s.resize(3700);
  double mean_w = 0;
  const ForeignRobot r;
  const auto states = driven(r, with, rest, 0.1);
  for (const ForeignState& s : states)
    mean_w += (s.battery_power_w - r.idle_w) / static_cast<double>(states.size());
  EXPECT_NEAR(mean_w, 50 * 6 / 37.0, 0.2);
}

class ForeignCases : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove_all(folder); }
  std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("joulecast-foreign-" + std::to_string(getpid()));
};

TEST_F(ForeignCases, DependsOnSeedAndIndex) {
  const auto digest_of_case = [&](std::uint64_t seed, std::size_t index, bool motors) {
    ForeignCase c = draw_foreign_case(seed, index);  // cases 1 and 7 have no planted effect
    c.drives.resize(1);
    return write_foreign_case(c, motors, {folder / "case"}).value();
  };
  const auto first = digest_of_case(3, 1, true);
  EXPECT_EQ(first, digest_of_case(3, 1, true));
  EXPECT_NE(first, digest_of_case(4, 1, true));
  EXPECT_NE(first, digest_of_case(3, 7, true));
  EXPECT_NE(first, digest_of_case(3, 1, false));
}

TEST_F(ForeignCases, PlantsStatedGap) {
  ForeignCase c = draw_foreign_case(3, 0);
  c.drives.resize(1);
  ASSERT_EQ(c.kind, Kind::single);
  ASSERT_EQ(c.effects.size(), 1u);
  EXPECT_GT(c.gap, 0.028);
  EXPECT_LT(c.gap, 0.16);
  ASSERT_TRUE(write_foreign_case(c, false, {folder / "case"}));
  const std::string log = (folder / "case/telemetry.lcmlog").string();
  const auto set = telemetry::load_recordings({&log, 1});
  ASSERT_TRUE(set);
  ASSERT_EQ(set->missions.size(), 1u);
  for (const signals::Sample& sample : set->missions.front().samples) {
    EXPECT_TRUE(std::isnan(sample.motor_current_a[0]));
    EXPECT_TRUE(std::isfinite(sample.battery_current_a));
  }
}

}  // namespace
}  // namespace joulecast::trial::foreign
