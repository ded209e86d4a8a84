// Calibration from battery power alone, against virtual robots with given parameters and without motor
// measurements, and against motions that do not identify them.
#include "energy/power_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "client/virtual_robot/fleet.h"
#include "energy/power_windows.h"
#include "robot/robot_file.h"
#include "signals/sample.h"

namespace joulecast::energy {
namespace {

struct Case {
  robot::RobotModel file;
  std::vector<telemetry::Recording> missions;
  std::map<std::string, double> truth;  // by the name of the estimate
};

std::vector<telemetry::Recording> power_drive(const virtual_robot::SimulationSpec& spec, std::uint64_t seed) {
  std::vector<telemetry::Recording> missions;
  virtual_robot::VirtualRobot machine(spec, seed);
  bool under_way = false;
  while (auto emission = machine.next()) {
    if (const auto* sample = std::get_if<signals::Sample>(&emission->message)) {
      if (under_way) missions.back().samples.push_back(*sample);
    } else if (const auto* event = std::get_if<signals::MissionEvent>(&emission->message)) {
      under_way = event->phase == signals::MissionPhase::started;
      if (under_way) missions.push_back({spec.robot.robot_id, event->mission_id, event->payload_kg, {}});
    }
  }
  return missions;
}

// A virtual robot that differs from its file in all parameters that battery power may identify.
Case misjudged_power(const virtual_robot::ShippedRobot& shipped, std::uint64_t seed) {
  Case c;
  c.file = robot::parse_robot(shipped.json_text).value();
  virtual_robot::SimulationSpec spec;
  spec.robot = virtual_robot::parse_robot(std::string(shipped.json_text)).value();
  spec.sensors.motor_channels = false;
  spec.missions = 10;
  virtual_robot::Rng rng = virtual_robot::Rng::stream(seed, 91);
  const double dry = rng.uniform(-0.4, 0.8), viscous = rng.uniform(-0.6, 1), scrub = rng.uniform(0, 0.2);
  const double idle_w = rng.uniform(-0.4, 0.6) * c.file.idle_power_w,
               heavier = rng.uniform(0, 0.25);  // rotors that the file leaves out
  spec.imperfections.coulomb_friction = dry;
  spec.imperfections.viscous_friction = viscous;
  spec.imperfections.turning_scrub = scrub;
  spec.imperfections.accessory_load = idle_w;
  spec.imperfections.linear_inertia_error = heavier;
  c.missions = power_drive(spec, seed);
  const robot::Motor& motor = c.file.motor;
  const double r = c.file.kinematics.wheel_radius_m;
  c.truth = {
      {"idle_power_w", c.file.idle_power_w + idle_w},
      {"friction_torque_nm mean",
       (motor.friction_torque_nm[0] + motor.friction_torque_nm[1]) / 2 * (1 + dry)},
      {"friction_torque_nm right - left",
       (motor.friction_torque_nm[0] - motor.friction_torque_nm[1]) * (1 + dry)},
      {"viscous_friction_nm_s_rad", motor.viscous_friction_nm_s_rad * (1 + viscous)},
      {"straight inertia", wheel_inertia(c.file).straight + heavier * c.file.total_mass_kg(0) * r * r / 2},
      {"turning inertia", wheel_inertia(c.file).turning},
      {"resistance_ohm", motor.resistance_ohm},
      {"turning_scrub", scrub},
      {"driver_loss", 0},
      {"no_regeneration", 0}};
  return c;
}

struct Coverage {
  int told = 0, within_two = 0, untold = 0;
  double square = 0;  // of the departure in standard errors, of identified ones
};

// Over several seeds of every robot.
class CalibratedFleet : public ::testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(OneSeed, CalibratedFleet, ::testing::Values(1));
INSTANTIATE_TEST_SUITE_P(LongThreeSeeds, CalibratedFleet, ::testing::Values(3));

TEST_P(CalibratedFleet, CoversTheTrueParameters) {
  std::map<std::string, Coverage> by_name;
  Coverage all;
  for (const auto& shipped : virtual_robot::shipped_robots()) {
    for (std::uint64_t seed = 1; seed <= GetParam(); ++seed) {
      const Case c = misjudged_power(shipped, seed);
      const auto found = calibrate_from_power(c.file, c.missions);
      ASSERT_TRUE(found) << describe(found.error());
      ASSERT_TRUE(robot::validate(found->robot));
      for (const ParameterEstimate& e : found->estimates) {
        const double z = (e.value - c.truth.at(std::string(e.name))) / e.standard_error;
        std::printf("%-5s %llu %-32s %10.4g +- %-8.3g true %10.4g z %5.1f %s\n",
                    std::string(shipped.kind).c_str(), static_cast<unsigned long long>(seed),
                    std::string(e.name).c_str(), e.value, e.standard_error, c.truth.at(std::string(e.name)),
                    z, e.fitted ? "" : e.note.c_str());
        if (e.value == 0) continue;  // held by a bound: rightly, where there is nothing
        for (Coverage* count : {&all, &by_name[std::string(e.name)]}) {
          (e.fitted ? count->told : count->untold)++;
          count->within_two += e.fitted && std::fabs(z) <= 2;
          if (e.fitted) count->square += z * z;
        }
      }
      std::printf("halves: file %.3f calibrated %.3f regression %.3f\n", found->halves.file,
                  found->halves.corrected, found->halves.regression);
      EXPECT_LT(found->halves.corrected, 1.02 * found->halves.regression);
    }
  }
  for (const auto& [name, count] : by_name)
    std::printf("%-32s told %2d, within two standard errors %2d, rms of z %.2f, untold %2d\n", name.c_str(),
                count.told, count.within_two, std::sqrt(count.square / std::max(count.told, 1)),
                count.untold);
  std::printf("all: told %d, within two standard errors %d\n", all.told, all.within_two);
  EXPECT_GE(all.within_two, 0.9 * all.told);
}

TEST(CalibrateFromPower, EstimatesEffectsAsInItsFile) {
  Case c = misjudged_power(virtual_robot::shipped_robots()[0], 1);
  c.file.effects.push_back({"turning_scrub", {{"coefficient", 0.2}, {"rate_rad_s", 0.02}}});
  const auto found = calibrate_from_power(c.file, c.missions);
  ASSERT_TRUE(found) << describe(found.error());
  const auto& of_file = found->robot.effects.front();
  ASSERT_EQ(of_file.id, "turning_scrub");
  const auto scrub = std::ranges::find(found->estimates, of_file.id, &ParameterEstimate::name);
  ASSERT_NE(scrub, found->estimates.end());
  EXPECT_NEAR(scrub->value, of_file.parameters.front().second, 1e-12);
  EXPECT_NEAR(scrub->value, c.truth["turning_scrub"], 3 * scrub->standard_error);
}

// Straight on at one speed: terms with and without the speed cannot be separated, and the robot neither turns
// nor accelerates.
// A robot that follows ramps of speed with corners at any time, straight on, and a meter of the mean power
// since the last row. The reference is the integral of the motors' equations over steps of a millisecond.
TEST(PowerWindows, KeepLossesOfRampsBetweenRows) {
  const robot::RobotModel file = robot::parse_robot(R"({"robot_id": "ramps", "idle_power_w": 20,
    "kinematics": {"wheel_radius_m": 0.1, "half_track_m": 0.2, "com_offset_m": 0},
    "mass": {"chassis_kg": 60, "wheel_kg": 2, "yaw_inertia_kg_m2": 4, "wheel_inertia_kg_m2": 0.01},
    "motor": {"resistance_ohm": 1.0, "inductance_h": 0, "torque_constant_nm_a": 1, "voltage_constant_v_s_rad": 1,
      "gear_ratio": 1, "viscous_friction_nm_s_rad": 0.05, "friction_torque_nm": [1, 1]},
    "battery": {"nominal_voltage_v": 24, "capacity_ah": 20, "internal_resistance_ohm": 0.02,
      "reserve_fraction": 0.1},
    "limits": {"speed_m_s": 2, "acceleration_m_s2": 1, "yaw_rate_rad_s": 2, "current_a": 40,
      "payload_kg": 20}})")
                                     .value();
  telemetry::Recording mission{"ramps", "m", 0, {}};
  double speed_rad_s = 20, energy_j = 0;
  int steps = 0;
  virtual_robot::Rng rng = virtual_robot::Rng::stream(5, 1);
  for (int row = 0; row < 600;) {
    const double slope_rad_s2 = rng.uniform(0.5, 3) * (speed_rad_s > 20 ? -1 : 1);
    for (double left_s = rng.uniform(3.1, 5); left_s > 0; left_s -= 1e-3) {
      speed_rad_s += 5e-4 * slope_rad_s2;
      const double torque_nm = 1 + 0.05 * speed_rad_s + (64 * 0.01 / 2 + 0.01) * slope_rad_s2;
      energy_j += 1e-3 * (20 + 2 * torque_nm * (torque_nm + speed_rad_s));
      speed_rad_s += 5e-4 * slope_rad_s2;
      if (++steps % 1000 != 0) continue;
      signals::Sample& s = mission.samples.emplace_back();
      s.utime_us = 1'750'000'000'000'000 + 1'000'000LL * ++row;
      s.wheel_velocity_rad_s = {speed_rad_s, speed_rad_s};
      s.battery_voltage_v = 24, s.battery_current_a = energy_j / 24;
      energy_j = 0;
    }
  }
  const auto data = power_windows({&mission, 1}, file, 1.0);
  ASSERT_TRUE(data) << describe(data.error());
  const dynamics::DriveModel model(file, {});
  ASSERT_GT(data->windows.size(), 500u);
  for (const windows::Window& w : data->windows)
    EXPECT_NEAR(metered_power_w(model, w), w.battery_power_w, 0.1) << w.t_s;
}

TEST(CalibrateFromPower, ReportsUnidentifiableParameters) {
  const auto shipped = virtual_robot::shipped_robots()[0];
  const robot::RobotModel robot = robot::parse_robot(shipped.json_text).value();
  const auto truth = dynamics::drive_model(robot).value();
  dynamics::Instant at;
  at.wheel_speed_rad_s = {8, 8};
  const double power_w = truth.flow(at).battery_power_w;
  telemetry::Recording mission{robot.robot_id, "straight", 0, {}};
  for (int k = 0; k < 6000; ++k) {
    signals::Sample s;
    s.utime_us = 1'000'000 + 20'000LL * k;
    s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    s.battery_voltage_v = 24;
    s.battery_current_a = (power_w + 0.5 * std::sin(k)) / 24;
    s.payload_kg = 0;
    mission.samples.push_back(s);
  }
  const auto found = calibrate_from_power(robot, std::vector{mission});
  ASSERT_TRUE(found) << describe(found.error());
  for (const ParameterEstimate& e : found->estimates) {
    EXPECT_FALSE(e.fitted) << e.name;
  }
  std::vector<std::string> untold;
  for (const Untold& u : found->untold) untold.push_back(u.what);
  EXPECT_THAT(untold, ::testing::IsSupersetOf({"friction_torque_nm mean", "viscous_friction_nm_s_rad",
                                               "friction_torque_nm right - left", "straight inertia",
                                               "turning inertia", "resistance_ohm"}));
  EXPECT_THAT(untold, ::testing::Contains(::testing::HasSubstr("torque_constant_nm_a")));
  EXPECT_NEAR(dynamics::drive_model(found->robot).value().flow(at).battery_power_w, power_w, 0.01 * power_w);

  for (signals::Sample& s : mission.samples) s.battery_current_a = std::nan("");
  const auto refused = calibrate_from_power(robot, std::vector{mission});
  ASSERT_FALSE(refused);
  EXPECT_THAT(describe(refused.error()), ::testing::HasSubstr("battery_current"));
}

}  // namespace
}  // namespace joulecast::energy
