// Coverage of the intervals that calibrations state, on robots of a plant that shares no equation with the
// product: inductance, friction by bristles, a sampled controller, readings at moments of their own.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "energy/calibration.h"
#include "energy/power_calibration.h"
#include "energy/power_windows.h"
#include "robot/robot_file.h"
#include "tests/study/trial/foreign/foreign_case.h"

namespace joulecast::energy {
namespace {

using trial::foreign::ForeignRobot;
using virtual_robot::Rng;

constexpr std::size_t missions_of_each = 8;
constexpr double rows_s = 0.02, slow_rows_s = 0.5;

// When the logger reads: at moments of its own, or always at the controller's.
enum class Phase { free, locked };
// Slow battery: half a second apart, with the mean power since the last row.
enum class Channels { motors, battery, slow_battery };

struct MadeRobot {
  robot::RobotModel file;
  std::vector<telemetry::Recording> missions;
  std::map<std::string, double> truth;  // by the name of the estimate
};

// Instantaneous readings with white noise; friction and idle power differ a little from mission to mission.
void record_mission(const ForeignRobot& built, const trial::foreign::Departures& with,
                    const trial::foreign::Drive& drive, Phase phase, Channels channels, double noise_a,
                    Rng& rng, MadeRobot& made) {
  ForeignRobot today = built;
  for (double& torque : today.friction_nm) torque *= 1 + 0.01 * rng.normal();
  today.idle_w *= 1 + 0.005 * rng.normal();
  const std::size_t number = made.missions.size();
  telemetry::Recording mission{"foreign", "m" + std::to_string(number), drive.payload_kg, {}};
  constexpr double state_s = 5e-4;
  const auto states = driven(today, with, drive, state_s, state_s);
  const auto start_us = 1'750'000'000'000'000 + static_cast<std::int64_t>(number) * 600'000'000;
  const bool slow = channels == Channels::slow_battery;
  for (double t = slow ? slow_rows_s : 0;; t += slow ? slow_rows_s : rows_s) {
    // Free moments lie in the middle of a millisecond, so that their mean is the middle of a controller's
    // period.
    const double at =
        phase == Phase::locked || slow ? t : t + 1e-3 * (0.5 + static_cast<double>(rng.index(10)));
    const auto k = static_cast<std::size_t>(std::lround(at / state_s));
    if (k >= states.size()) break;
    const trial::foreign::ForeignState& s = states[k];
    signals::Sample sample;
    sample.utime_us = start_us + std::llround(s.time_s * 1e6);
    sample.sequence = static_cast<std::int64_t>(mission.samples.size());
    for (const std::size_t side : {0u, 1u})
      sample.wheel_velocity_rad_s[side] = s.wheel_rad_s[side] + 0.01 * rng.normal();
    sample.battery_voltage_v = s.battery_voltage_v + 0.01 * rng.normal();
    sample.battery_current_a = s.battery_current_a + 0.02 * rng.normal();
    if (slow) {
      double power_w = 0;
      const auto states_a_row = static_cast<std::size_t>(std::lround(slow_rows_s / state_s));
      for (std::size_t j = k + 1 - states_a_row; j <= k; ++j)
        power_w +=
            states[j].battery_voltage_v * states[j].battery_current_a / static_cast<double>(states_a_row);
      sample.battery_current_a = power_w / sample.battery_voltage_v + 0.02 * rng.normal();
    }
    sample.pose = {s.x_m, s.y_m, s.heading_rad};
    sample.payload_kg = drive.payload_kg;
    for (const std::size_t side : {0u, 1u}) {
      if (channels != Channels::motors) break;
      sample.motor_voltage_v[side] = s.voltage_v[side] + 0.05 * rng.normal();
      sample.motor_current_a[side] = s.current_a[side] + noise_a * rng.normal();
    }
    mission.samples.push_back(sample);
  }
  made.missions.push_back(std::move(mission));
}

MadeRobot make_robot(std::uint64_t seed, Channels channels, Phase phase = Phase::free) {
  Rng rng = Rng::stream(seed, 36);
  const ForeignRobot file = trial::foreign::draw_robot_file(rng);
  MadeRobot made;
  made.file = robot::parse_robot(trial::foreign::robot_json_text(file)).value();
  ForeignRobot built = file;
  for (double& torque : built.friction_nm) torque *= rng.uniform(0.7, 1.6);
  built.viscous_nm_s_rad *= rng.uniform(0.5, 2);
  built.resistance_ohm *= rng.uniform(0.8, 1.3);
  built.constant_nm_a *= rng.uniform(0.97, 1.03);
  built.chassis_kg *= rng.uniform(0.95, 1.2);
  built.yaw_inertia_kg_m2 *= rng.uniform(0.9, 1.3);
  built.idle_w *= rng.uniform(0.7, 1.5);
  const double noise_a = rng.uniform(0.03, 0.3);
  std::vector<trial::foreign::Drive> drives;
  for (std::size_t m = 0; m < missions_of_each; ++m)
    drives.push_back(draw_drive(file, rng.uniform(50, 80), rng));
  // Battery power identifies these effects too; motor channels have no equation for the scrub.
  trial::foreign::Departures with;
  if (channels != Channels::motors && rng.chance(0.5)) with.scrub = rng.uniform(0, 0.3);
  if (rng.chance(0.5)) with.driver_loss = rng.uniform(0, 0.08);
  if (rng.chance(0.3)) with.unreturned = rng.uniform(0.2, 1);
  for (const auto& drive : drives) record_mission(built, with, drive, phase, channels, noise_a, rng, made);
  const double r = built.radius_m, mass_kg = built.chassis_kg + 2 * built.wheel_kg,
               arm = r / (2 * built.half_track_m), k = file.constant_nm_a / built.constant_nm_a;
  // The coefficient counts with the mass of the file.
  double moved_kg = 0, declared_kg = 0;
  for (const auto& drive : drives) {
    moved_kg += mass_kg + drive.payload_kg;
    declared_kg += file.chassis_kg + 2 * file.wheel_kg + drive.payload_kg;
  }
  const double weight_ratio = moved_kg / declared_kg;
  made.truth = {{"resistance_ohm", built.resistance_ohm},
                {"resistance_ohm by power", built.resistance_ohm * k * k},
                {"voltage_constant_v_s_rad", built.constant_nm_a},
                {"torque_constant_nm_a", built.constant_nm_a},
                {"friction_torque_nm right", built.friction_nm[0]},
                {"friction_torque_nm left", built.friction_nm[1]},
                {"friction_torque_nm mean", (built.friction_nm[0] + built.friction_nm[1]) / 2},
                {"friction_torque_nm right - left", built.friction_nm[0] - built.friction_nm[1]},
                {"viscous_friction_nm_s_rad", built.viscous_nm_s_rad},
                {"straight inertia", mass_kg * r * r / 2 + built.wheel_inertia_kg_m2},
                {"turning inertia", 2 * built.yaw_inertia_kg_m2 * arm * arm + built.wheel_inertia_kg_m2},
                {"idle_power_w", built.idle_w},
                {"turning_scrub", with.scrub * weight_ratio},
                {"driver_loss", with.driver_loss},
                {"no_regeneration", with.unreturned}};
  return made;
}

struct Covered {
  int fitted = 0, within = 0;
  double z = 0, zz = 0, relative = 0;
};
using Table = std::map<std::string, Covered>;

void count_covered(const std::string& method, const std::vector<ParameterEstimate>& estimates,
                   const MadeRobot& made, Table& table) {
  for (const ParameterEstimate& e : estimates) {
    if (!e.fitted) continue;
    std::string name(e.name);
    if (method == "power" && name == "resistance_ohm") name += " by power";
    const double truth = made.truth.at(name), z = (e.value - truth) / e.standard_error;
    Covered& c = table[method + " " + name];
    ++c.fitted;
    c.within += std::fabs(z) <= 1.96;
    c.z += z;
    c.zz += z * z;
    c.relative += (e.value - truth) / (truth == 0 ? 1 : truth);
  }
}

void print_table(const Table& table) {
  for (const auto& [name, c] : table)
    std::printf("%-40s fitted %3d within %5.1f %% mean z %5.2f rms z %5.2f mean error %8.4f %%\n",
                name.c_str(), c.fitted, 100.0 * c.within / c.fitted, c.z / c.fitted,
                std::sqrt(c.zz / c.fitted), 100 * c.relative / c.fitted);
}

struct Extent {
  int robots;
  double least,
      most;  // share of intervals that contain the truth, of each parameter; of few robots by chance
};

class CalibrationCoverage : public ::testing::TestWithParam<Extent> {
 protected:
  Table power_table(Channels channels) const {
    Table table;
    for (int n = 1; n <= GetParam().robots; ++n) {
      const MadeRobot made = make_robot(static_cast<std::uint64_t>(n), channels);
      const auto found = calibrate_from_power(made.file, made.missions);
      EXPECT_TRUE(found) << describe(found.error());
      if (found) count_covered("power", found->estimates, made, table);
    }
    return table;
  }
  void expect_covered(const Table& table) const {
    print_table(table);
    for (const auto& [name, c] : table) {
      if (c.fitted < GetParam().robots / 8) continue;
      EXPECT_GE(c.within, GetParam().least * c.fitted) << name;
      EXPECT_LE(c.within, GetParam().most * c.fitted) << name;
    }
  }
};
INSTANTIATE_TEST_SUITE_P(FewRobots, CalibrationCoverage, ::testing::Values(Extent{12, 0.75, 1}));
INSTANTIATE_TEST_SUITE_P(LongManyRobots, CalibrationCoverage, ::testing::Values(Extent{200, 0.90, 0.985}));

TEST_P(CalibrationCoverage, CoversParametersFromMotors) {
  Table table;
  for (int n = 1; n <= GetParam().robots; ++n) {
    const MadeRobot made = make_robot(static_cast<std::uint64_t>(n), Channels::motors);
    for (const auto& [name, method] :
         {std::pair{"steady", CalibrationMethod::steady}, std::pair{"whole", CalibrationMethod::whole}}) {
      const auto found = calibrate_drive(made.file, made.missions, {.method = method});
      ASSERT_TRUE(found) << describe(found.error());
      count_covered(name, found->estimates, made, table);
    }
  }
  expect_covered(table);
}

TEST_P(CalibrationCoverage, CoversParametersFromPower) {
  expect_covered(power_table(Channels::battery));
}

TEST_P(CalibrationCoverage, CoversParametersFromSlowRows) {
  expect_covered(power_table(Channels::slow_battery));
}

// A voltage that begins with a controller's period of 10 ms is read together with the last period's current.
TEST(CalibrateLockedReadings, DetectsTheSamplingPhase) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    for (const Phase phase : {Phase::free, Phase::locked}) {
      const MadeRobot made = make_robot(seed, Channels::motors, phase);
      const auto found = calibrate_drive(made.file, made.missions, {.method = CalibrationMethod::whole});
      ASSERT_TRUE(found) << describe(found.error());
      if (phase == Phase::free) {
        EXPECT_EQ(found->electrical_delay_s, 0) << seed;
        continue;
      }
      EXPECT_NEAR(found->electrical_delay_s, trial::foreign::controller_period_s, 2e-3) << seed;
      for (const ParameterEstimate& e : found->estimates) {
        if (!e.name.ends_with("inertia")) continue;
        const double truth = made.truth.at(std::string(e.name));
        EXPECT_NEAR(e.value, truth, 2 * e.standard_error) << seed << e.name;
        EXPECT_GT(std::fabs(e.value - truth), 0.02 * truth) << "the phase does not matter";
      }
    }
  }
}

}  // namespace
}  // namespace joulecast::energy
