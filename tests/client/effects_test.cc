#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "tests/client/robots.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::virtual_robot {
namespace {

SimulationSpec quiet_spec(std::string_view kind) {
  SimulationSpec spec;
  spec.robot = shipped(kind);
  spec.missions = 2;
  spec.scatter = 0;
  spec.sensors.noise = false;
  return spec;
}

// With this seed both missions carry loads.
constexpr std::uint64_t loaded_seed = 7;

struct Expected {
  std::string_view id;
  double strength;
};

// Effects that raise battery energy above the robot file's prediction for the same motion.
class CostlyEffect : public ::testing::TestWithParam<Expected> {};
INSTANTIATE_TEST_SUITE_P(
    All, CostlyEffect,
    ::testing::Values(
        Expected{"coulomb_friction", 0.3}, Expected{"viscous_friction", 1}, Expected{"stribeck_friction", 2},
        Expected{"friction_asymmetry", 0.6}, Expected{"load_rolling_resistance", 0.03},
        Expected{"floor_resistance_zone", 0.03}, Expected{"aerodynamic_drag", 10},
        Expected{"turning_scrub", 0.1}, Expected{"gear_efficiency", 0.2}, Expected{"chassis_mass_error", 1},
        Expected{"payload_mass_error", 1}, Expected{"yaw_inertia_error", 3},
        Expected{"linear_inertia_error", 1}, Expected{"resistance_error", 1},
        Expected{"winding_temperature", 40}, Expected{"brush_drop", 0.3},
        Expected{"torque_constant_loss", 0.2}, Expected{"accessory_load", 5}, Expected{"driver_loss", 0.1},
        Expected{"no_regeneration", 1}, Expected{"wheel_slip", 0.1}, Expected{"current_sensor_gain", 0.05},
        Expected{"current_sensor_bias", 0.1}, Expected{"voltage_sensor_gain", 0.05},
        Expected{"x_radio_zone", 10}, Expected{"x_periodic_load", 10}, Expected{"x_cogging", 0.5},
        Expected{"x_start_burst", 20}, Expected{"x_speed_cubed", 1}, Expected{"x_heading_load", 10},
        Expected{"x_sag_load", 10}, Expected{"x_cold_bearing", 1}, Expected{"x_cold_grease", 2},
        Expected{"x_brake_drag", 1}, Expected{"x_floor_patches", 0.03}, Expected{"x_payload_speed", 0.1},
        Expected{"x_turn_lamp", 20}, Expected{"x_warm_fan", 0.3}),
    [](const auto& effect) { return std::string(effect.param.id); });

TEST_P(CostlyEffect, EnergyRisesWithStrength) {
  SimulationSpec spec = quiet_spec("amr");
  const PowerGap none = power_gap(spec, loaded_seed);
  const auto gap_at = [&](double strength) {
    auto imperfections = make_imperfections({{std::string(GetParam().id), strength}});
    EXPECT_TRUE(imperfections);
    spec.imperfections = *imperfections;
    return power_gap(spec, loaded_seed);
  };
  const PowerGap half = gap_at(0.5 * GetParam().strength);
  const PowerGap whole = gap_at(GetParam().strength);
  EXPECT_GT(half.energy, none.energy);
  EXPECT_GT(whole.energy, half.energy);
  EXPECT_GT(whole.added(), half.added());
}

TEST(Effects, EveryEffectIsTested) {
  constexpr std::array<std::string_view, 9> others{"slope",
                                                   "com_offset",
                                                   "inductance",
                                                   "battery_resistance",
                                                   "wheel_radius_error",
                                                   "wheel_radius_asymmetry",
                                                   "track_error",
                                                   "sensor_delay",
                                                   "x_oval_wheel"};
  // The 38 costly effects above.
  EXPECT_EQ(effect_table().size(), 38 + others.size());
  EXPECT_EQ(all_effects().size(), effect_table().size() + 2);  // grade and x_cpu_load, below
  for (const auto id : others) {
    EXPECT_TRUE(std::any_of(effect_table().begin(), effect_table().end(), [&](const auto& e) {
      return e.id == id;
    })) << id;
  }
}

Simulation with(SimulationSpec spec, std::string_view id, double strength) {
  auto imperfections = make_imperfections({{std::string(id), strength}});
  EXPECT_TRUE(imperfections);
  spec.imperfections = *imperfections;
  return simulate_missions(spec, loaded_seed);
}

double path_length(const Simulation& run) {
  double length = 0;
  for (std::size_t k = 1; k < run.samples.size(); ++k) {
    length += std::hypot(run.samples[k].pose[0] - run.samples[k - 1].pose[0],
                         run.samples[k].pose[1] - run.samples[k - 1].pose[1]);
  }
  return length;
}

// Largest |yaw - c (w_r - w_l)| over all samples for c of the given geometry.
double worst_yaw_mismatch(const Simulation& run, double right_m, double left_m, double half_track_m) {
  double worst = 0;
  for (const auto& s : run.samples) {
    const double yaw =
        (right_m * s.wheel_velocity_rad_s[0] - left_m * s.wheel_velocity_rad_s[1]) / (2 * half_track_m);
    worst = std::max(worst, std::abs(s.yaw_rate_rad_s - yaw));
  }
  return worst;
}

TEST(Effects, GeometryErrorsAppearInYaw) {
  const SimulationSpec spec = quiet_spec("amr");
  const double r = spec.robot.wheel_radius_m;
  const double l = spec.robot.half_track_m;
  EXPECT_LT(worst_yaw_mismatch(with(spec, "accessory_load", 1), r, r, l), 1e-12);
  EXPECT_LT(worst_yaw_mismatch(with(spec, "track_error", 0.1), r, r, 1.1 * l), 1e-12);
  EXPECT_LT(worst_yaw_mismatch(with(spec, "wheel_radius_error", 0.04), 1.04 * r, 1.04 * r, l), 1e-12);
  EXPECT_LT(worst_yaw_mismatch(with(spec, "wheel_radius_asymmetry", 0.04), 1.02 * r, 0.98 * r, l), 1e-12);
  EXPECT_LT(worst_yaw_mismatch(with(spec, "wheel_slip", 0.04), 0.96 * r, 0.96 * r, l), 1e-12);

  const auto travelled = [&](const Simulation& run) {
    double by_wheels = 0;
    for (const auto& s : run.samples) {
      by_wheels += std::abs(r * (s.wheel_velocity_rad_s[0] + s.wheel_velocity_rad_s[1]) / 2) / spec.rate_hz;
    }
    return path_length(run) / by_wheels;
  };
  // The error of 20 ms chords and of the rectangle rule is a few parts in 1e5 at these speeds.
  EXPECT_NEAR(travelled(with(spec, "wheel_radius_error", 0.04)), 1.04, 1e-3);
  EXPECT_NEAR(travelled(with(spec, "wheel_slip", 0.04)), 0.96, 1e-3);
}

TEST(Effects, SlopeConservesPotentialEnergy) {
  SimulationSpec spec = quiet_spec("amr");
  spec.world.slope_direction_rad = 0;
  const Simulation run = with(spec, "slope", 0.02);
  const auto& first = run.truth.missions.front();
  const auto ends = [&] {
    const auto last = std::find_if(run.samples.begin(), run.samples.end(),
                                   [&](const auto& s) { return s.utime_us >= run.events[1].utime_us; });
    return std::pair{run.samples.front().pose[0], (last - 1)->pose[0]};
  }();
  // m g sin(a) times the distance uphill. The robot is at rest at either end, so samples 20 ms apart are at
  // the same place.
  const double mass_kg = spec.robot.chassis_kg + 2 * spec.robot.wheel_kg + first.payload_kg;
  EXPECT_NEAR(first.accounts.potential, mass_kg * 9.80665 * std::sin(0.02) * (ends.second - ends.first),
              0.05);
}

TEST(Effects, HillsConservePotentialEnergy) {
  SimulationSpec spec = quiet_spec("amr");
  spec.missions = 1;
  spec.sensors.pitch = true;
  spec.sensors.covariates_hz = 50;
  const Simulation run = with(spec, "grade", 0.06);
  const auto& mission = run.truth.missions.front();
  ASSERT_EQ(run.covariates.size(), run.samples.size());
  const auto height = [&](std::size_t k) { return run.covariates[k].covariates[1].value; };
  EXPECT_EQ(run.covariates[0].covariates[1].name, "height_m");
  const double pi = 3.14159265358979323846, k = 2 * pi / spec.world.hill_m;
  double steepest = 0, climbed_m = 0;
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    const auto& s = run.samples[i];
    EXPECT_NEAR(height(i), 0.06 / k * std::sin(k * s.pose[0]) * std::cos(k * s.pose[1]), 1e-9);
    steepest = std::max(steepest, std::abs(s.pitch_rad));
    if (i == 0) continue;
    // Forwards or backwards along the mean heading of the two samples.
    const auto& before = run.samples[i - 1];
    const double heading = before.pose[2] + 0.5 * std::remainder(s.pose[2] - before.pose[2], 2 * pi);
    const double way =
        (s.pose[0] - before.pose[0]) * std::cos(heading) + (s.pose[1] - before.pose[1]) * std::sin(heading);
    climbed_m += 0.5 * (std::sin(s.pitch_rad) + std::sin(run.samples[i - 1].pitch_rad)) * way;
  }
  EXPECT_GT(steepest, 0.03);
  EXPECT_LT(steepest, 0.061);
  EXPECT_NEAR(climbed_m, height(run.samples.size() - 1) - height(0), 2e-3);
  const double mass_kg = spec.robot.chassis_kg + 2 * spec.robot.wheel_kg + mission.payload_kg;
  EXPECT_NEAR(mission.accounts.potential, mass_kg * 9.80665 * (height(run.samples.size() - 1) - height(0)),
              0.1);
}

TEST(Effects, ComputerPowerFollowsLoad) {
  SimulationSpec spec = quiet_spec("amr");
  spec.sensors.covariates_hz = 10;
  const Simulation idle = with(spec, "x_cpu_load", 0), busy = with(spec, "x_cpu_load", 40);
  ASSERT_EQ(idle.samples.size(), busy.samples.size());
  double least = 1, most = 0;
  std::size_t next = 0;
  for (std::size_t k = 0; k < busy.samples.size(); ++k) {
    while (next < busy.covariates.size() && busy.covariates[next].utime_us <= busy.samples[k].utime_us)
      ++next;
    const auto& [name, load] = busy.covariates[next - 1].covariates[0];
    ASSERT_EQ(name, "cpu_load");
    least = std::min(least, load);
    most = std::max(most, load);
    if (busy.covariates[next - 1].utime_us != busy.samples[k].utime_us) continue;
    const auto power = [](const signals::Sample& s) { return s.battery_voltage_v * s.battery_current_a; };
    // The bus sags under the load, which changes the power of the drives slightly.
    EXPECT_NEAR(power(busy.samples[k]) - power(idle.samples[k]), 40 * load, 0.5);
  }
  EXPECT_GE(least, 0);
  EXPECT_LE(most, 1);
  EXPECT_GT(most - least, 0.3);
}

TEST(Effects, PublishesCovariatesOnRequestOnly) {
  const Simulation run = with(quiet_spec("amr"), "grade", 0.05);
  EXPECT_TRUE(run.covariates.empty());
  for (const auto& s : run.samples) ASSERT_TRUE(std::isnan(s.pitch_rad));
}

TEST(Effects, DelayShiftsElectricalChannelsOnly) {
  const SimulationSpec spec = quiet_spec("amr");
  const Simulation prompt = with(spec, "sensor_delay", 0);
  const Simulation late = with(spec, "sensor_delay", 0.1);
  ASSERT_EQ(prompt.samples.size(), late.samples.size());
  for (std::size_t k = 100; k < 4000; ++k) {
    ASSERT_EQ(late.samples[k].wheel_velocity_rad_s, prompt.samples[k].wheel_velocity_rad_s);
    // History is kept at the start of each control period; samples at 50 Hz see every fourth.
    ASSERT_NEAR(late.samples[k].motor_current_a[0], prompt.samples[k - 5].motor_current_a[0], 1e-9) << k;
    ASSERT_NEAR(late.samples[k].motor_voltage_v[1], prompt.samples[k - 5].motor_voltage_v[1], 1e-9) << k;
    ASSERT_NEAR(late.samples[k].battery_current_a, prompt.samples[k - 5].battery_current_a, 1e-9) << k;
  }
}

TEST(Effects, BatteryResistanceSagsVoltage) {
  const SimulationSpec spec = quiet_spec("amr");
  const Simulation plain = with(spec, "battery_resistance", 0);
  const Simulation weak = with(spec, "battery_resistance", 5);
  ASSERT_EQ(plain.samples.size(), weak.samples.size());
  double sag = 0;
  for (std::size_t k = 0; k < plain.samples.size(); ++k) {
    const auto& a = plain.samples[k];
    const auto& b = weak.samples[k];
    ASSERT_NEAR(b.battery_voltage_v * b.battery_current_a, a.battery_voltage_v * a.battery_current_a, 1e-6);
    sag += a.battery_voltage_v - b.battery_voltage_v;
  }
  EXPECT_GT(sag, 0);
}

TEST(Effects, InductanceChangesOnlyTransients) {
  // Both cancel in a mission's mean work, to first order, and both change the absolute power.
  SimulationSpec spec = quiet_spec("amr");
  for (const auto& [id, strength] : {std::pair{"inductance", 0.02}, std::pair{"com_offset", 0.3}}) {
    spec.imperfections = *make_imperfections({{id, strength}});
    const PowerGap gap = power_gap(spec, loaded_seed);
    EXPECT_GT(gap.added(), 0) << id;
    EXPECT_LT(std::abs(gap.energy), gap.absolute) << id;
  }
}

TEST(Effects, RejectsUnknownIdsAndStrengths) {
  const auto complaint = [](const char* id, double strength) {
    return describe(make_imperfections({{id, strength}}).error());
  };
  EXPECT_THAT(
      complaint("coulomb_fricton", 0.1),
      ::testing::EndsWith(
          "coulomb_fricton is not an effect; --list-effects lists them; did you mean coulomb_friction?"));
  EXPECT_THAT(complaint("flux_capacitor", 0.1),
              ::testing::EndsWith("flux_capacitor is not an effect; --list-effects lists them"));
  EXPECT_THAT(complaint("slope", 3),
              ::testing::HasSubstr("--effect: the strength of slope must be -0.2 to 0.2"));
  EXPECT_THAT(complaint("slope", std::nan("")),
              ::testing::HasSubstr("the strength of slope must be -0.2 to 0.2"));
}

}  // namespace
}  // namespace joulecast::virtual_robot
