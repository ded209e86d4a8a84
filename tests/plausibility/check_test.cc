#include "plausibility/check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "plausibility/observation.h"
#include "tests/plausibility/alterations.h"
#include "tests/plausibility/made_recordings.h"
#include "tests/support/sample_robots.h"

namespace joulecast::plausibility {
namespace {

namespace vr = virtual_robot;

const Check* find(const std::vector<Check>& checks, std::string_view id) {
  const auto at = std::ranges::find(checks, id, &Check::id);
  return at == checks.end() ? nullptr : &*at;
}

const made::Robot& scout() {
  static const made::Robot robot =
      made::virtual_robot("nomad", 31, [](vr::SimulationSpec& s) { s.sensors.pitch = true; });
  return robot;
}

TEST(SilenceContradicted, RemovesContradictedChannelOnly) {
  telemetry::RecordingSet set = scout().recordings;
  const std::vector<Check> checks{{"dead_channel", "motor_current.left, pose", 0, {}, "", true, {}},
                                  {"held_samples", "yaw_rate", 0, {}, "", false, {}}};
  silence_contradicted(set, checks);
  const signals::Sample& s = set.missions[1].samples[7];
  EXPECT_TRUE(std::isnan(s.motor_current_a[1]));
  EXPECT_TRUE(std::isnan(s.pose[0]) && std::isnan(s.pose[1]) && std::isnan(s.pose[2]));
  EXPECT_TRUE(std::isfinite(s.motor_current_a[0]));
  EXPECT_TRUE(std::isfinite(s.yaw_rate_rad_s));
}

TEST(SilenceContradicted, DividesByConfirmedFactor) {
  telemetry::RecordingSet set = scout().recordings;
  const signals::Sample before = set.missions[1].samples[7];
  Check check{"wheel_velocity_scale", "wheel_velocity", 2, {}, "", true, {}, {1}};
  check.factor = 2;
  silence_contradicted(set, std::vector<Check>{check});
  EXPECT_EQ(set.missions[1].samples[7].wheel_velocity_rad_s[1], before.wheel_velocity_rad_s[1] / 2);
  EXPECT_EQ(set.missions[1].samples[7].yaw_rate_rad_s, before.yaw_rate_rad_s);
  EXPECT_EQ(set.missions[0].samples[7].wheel_velocity_rad_s,
            scout().recordings.missions[0].samples[7].wheel_velocity_rad_s);
}

TEST(SilenceContradicted, RemovesChannelPerMission) {
  telemetry::RecordingSet set = scout().recordings;
  silence_contradicted(set, std::vector<Check>{{"dead_channel", "yaw_rate", 0, {}, "", true, {}, {1}}});
  EXPECT_TRUE(std::isfinite(set.missions[0].samples[7].yaw_rate_rad_s));
  EXPECT_TRUE(std::isnan(set.missions[1].samples[7].yaw_rate_rad_s));
}

// A sensor that is reversed in one mission or scaled in two is reported for these missions only.
TEST(CheckRecordings, NamesFaultyMissions) {
  ASSERT_GE(scout().recordings.missions.size(), 4u);
  const auto wrong = [](std::vector<std::size_t> missions, std::size_t reading, double factor) {
    telemetry::RecordingSet set = scout().recordings;
    for (const std::size_t m : missions) {
      for (signals::Sample& s : set.missions[m].samples) *signals::numbers_of(s)[reading] *= factor;
    }
    return set;
  };
  const auto told = [](const std::vector<Check>& checks, std::string_view id, std::string_view channel,
                       std::vector<std::size_t> missions) {
    const Check* check = find(checks, id);
    ASSERT_TRUE(check) << id;
    EXPECT_EQ(check->channel, channel);
    EXPECT_EQ(check->few_missions, missions);
    EXPECT_TRUE(check->contradicted);
    EXPECT_NE(check->says.find("In " + std::to_string(missions.size()) + " of "), std::string::npos);
    EXPECT_NE(check->says.find(scout().recordings.missions[missions.front()].mission_id), std::string::npos);
    EXPECT_EQ(std::ranges::count_if(checks, &Check::contradicted), 1);
  };
  told(check_recordings(wrong({2}, reading::battery_current, -1), scout().model), "battery_current_reversed",
       "battery_current", {2});
  told(check_recordings(wrong({0, 3}, reading::yaw_rate, 180 / std::numbers::pi), scout().model),
       "yaw_rate_scale", "yaw_rate", {0, 3});
  // Together with a channel that is faulty in all missions.
  telemetry::RecordingSet dead = wrong({2}, reading::battery_current, -1);
  alter::multiply(dead, {reading::yaw_rate}, 0);
  const auto both = check_recordings(dead, scout().model);
  ASSERT_TRUE(find(both, "battery_current_reversed"));
  EXPECT_EQ(find(both, "battery_current_reversed")->few_missions, std::vector<std::size_t>{2});
  ASSERT_TRUE(find(both, "dead_channel"));
  EXPECT_TRUE(find(both, "dead_channel")->few_missions.empty());

  std::vector<std::size_t> all(scout().recordings.missions.size());
  std::iota(all.begin(), all.end(), 0);
  const auto checks = check_recordings(wrong(all, reading::battery_current, -1), scout().model);
  ASSERT_TRUE(find(checks, "battery_current_reversed"));
  EXPECT_TRUE(find(checks, "battery_current_reversed")->few_missions.empty());
}

TEST(CheckRecordings, HidesChecksOnWrongClock) {
  telemetry::RecordingSet set = scout().recordings;
  alter::scale_clock(set, 1e3);
  const auto checks = check_recordings(set, scout().model);
  ASSERT_EQ(checks.size(), 1u);
  EXPECT_EQ(checks[0].id, "utime_scale");
  EXPECT_EQ(checks[0].channel, "utime");
}

TEST(CheckRecordings, DerivesClockUnitFromYear) {
  for (const auto& [unit, factor] : {std::pair{"in ms", 1e-3}, {"in s", 1e-6}, {"in ns", 1e3}}) {
    telemetry::RecordingSet set = scout().recordings;
    alter::scale_clock(set, factor);
    const auto checks = check_recordings(set, scout().model);
    ASSERT_TRUE(find(checks, "utime_scale")) << unit;
    EXPECT_NE(find(checks, "utime_scale")->says.find(std::string("given ") + unit), std::string::npos)
        << find(checks, "utime_scale")->says;
  }
}

TEST(CheckRecordings, AcceptsSteppedSparseRows) {
  telemetry::RecordingSet set = scout().recordings;
  for (auto& mission : set.missions) {
    std::vector<signals::Sample> stepped;
    for (const signals::Sample& s : mission.samples) {
      if (!stepped.empty()) {
        stepped.push_back(stepped.back());
        stepped.back().utime_us = s.utime_us - 100;  // as in the import
      }
      stepped.push_back(s);
    }
    for (std::size_t k = 0; k < stepped.size(); ++k) stepped[k].sequence = static_cast<std::int64_t>(k);
    mission.samples = std::move(stepped);
  }
  const auto checks = check_recordings(set, scout().model);
  EXPECT_FALSE(find(checks, "utime_scale"));
  EXPECT_FALSE(find(checks, "held_samples"));
}

TEST(CheckRecordings, ReportsImplausibleReadings) {
  telemetry::RecordingSet set = scout().recordings;
  set.beyond_range["battery_current"] = {set.samples / 20, 2800};
  EXPECT_FALSE(find(check_recordings(set, scout().model), "implausible_readings"));
  set.beyond_range["battery_current"].samples = 2 * set.samples;
  const auto checks = check_recordings(set, scout().model);
  ASSERT_TRUE(find(checks, "implausible_readings"));
  EXPECT_TRUE(checks.front().contradicted);
  EXPECT_EQ(checks.front().channel, "battery_current");
  EXPECT_NE(checks.front().says.find("(in mA?)"), std::string::npos);
}

TEST(CheckRecordings, NamesShortMissions) {
  telemetry::RecordingSet set = scout().recordings;
  set.missions.push_back(set.missions.front());
  set.missions.back().mission_id = "stub";
  set.missions.back().samples.resize(60);
  const auto checks = check_recordings(set, scout().model);
  ASSERT_TRUE(find(checks, "short_missions"));
  EXPECT_EQ(find(checks, "short_missions")->value, 1);
  EXPECT_NE(find(checks, "short_missions")->says.find("stub"), std::string::npos);
}

TEST(CheckRecordings, ReportsDisorderAndGaps) {
  telemetry::RecordingSet set = scout().recordings;
  for (auto& mission : set.missions) {
    for (std::size_t k = 1; k < mission.samples.size(); ++k) {
      if (k % 20 == 0) mission.samples[k].utime_us = mission.samples[k - 1].utime_us;
    }
    for (std::size_t k = mission.samples.size() / 2; k < mission.samples.size(); ++k) {
      mission.samples[k].utime_us += 20'000'000;
    }
  }
  const auto checks = check_recordings(set, scout().model);
  ASSERT_TRUE(find(checks, "utime_order"));
  ASSERT_TRUE(find(checks, "utime_gaps"));
  EXPECT_NEAR(find(checks, "utime_gaps")->value, 20.0 * static_cast<double>(set.missions.size()), 3);
}

TEST(CheckRecordings, ReportsImpossibleYear) {
  telemetry::RecordingSet set = scout().recordings;
  alter::each_sample(set, [](signals::Sample& s) { s.utime_us += 10'000'000'000'000'000; });
  const auto checks = check_recordings(set, scout().model);
  ASSERT_TRUE(find(checks, "utime_year"));
  EXPECT_GT(find(checks, "utime_year")->value, 2300);
}

TEST(CheckRecordings, ReportsPitchAndPayloadUnits) {
  telemetry::RecordingSet degrees = scout().recordings;
  alter::each_sample(degrees, [](signals::Sample& s) { s.pitch_rad = 12 + 57.3 * s.pitch_rad; });
  ASSERT_TRUE(find(check_recordings(degrees, scout().model), "pitch_scale"));
  telemetry::RecordingSet grams = scout().recordings;
  alter::multiply(grams, {reading::payload}, 1000);
  ASSERT_TRUE(find(check_recordings(grams, scout().model), "payload_scale"));
  EXPECT_FALSE(find(check_recordings(scout().recordings, scout().model), "payload_scale"));
}

TEST(CheckRecordings, ReportsUnexplainedSpeedOverLimit) {
  robot::RobotModel slow = scout().model;
  slow.limits.speed_m_s /= 2.2;
  slow.limits.yaw_rate_rad_s /= 3;
  const auto checks = check_recordings(scout().recordings, slow);
  ASSERT_TRUE(find(checks, "speed_over_limit"));
  EXPECT_GT(find(checks, "speed_over_limit")->value, 1.5);
  ASSERT_TRUE(find(checks, "yaw_rate_over_limit"));
  EXPECT_TRUE(std::ranges::none_of(checks, &Check::contradicted));
}

TEST(CheckRecordings, MeasuresHeldReadings) {
  for (const double step_a : {0.0, 0.02}) {
    telemetry::RecordingSet set = scout().recordings;
    if (step_a > 0) alter::round_to(set, {reading::battery_current}, step_a);
    EXPECT_FALSE(find(check_recordings(set, scout().model), "held_samples"));
    alter::hold(set, {reading::battery_current}, 0.2);
    const auto checks = check_recordings(set, scout().model);
    ASSERT_TRUE(find(checks, "held_samples"));
    EXPECT_NEAR(find(checks, "held_samples")->value, 0.2, 0.01);
  }
}

// Speeds of few levels repeat from row to row without being held.
TEST(CheckRecordings, CoarseSpeedsAreNotHeld) {
  telemetry::RecordingSet set = scout().recordings;
  alter::round_to(set, {reading::wheel_velocity, reading::wheel_velocity + 1}, 0.3);
  EXPECT_FALSE(find(check_recordings(set, scout().model), "held_samples"));
}

TEST(CheckRecordings, ReportsMostlyMissingChannel) {
  telemetry::RecordingSet set = scout().recordings;
  for (auto& mission : set.missions) {
    for (std::size_t k = 200; k < mission.samples.size(); ++k) {
      mission.samples[k].yaw_rate_rad_s = std::numeric_limits<double>::quiet_NaN();
    }
  }
  const auto checks = check_recordings(set, scout().model);
  ASSERT_TRUE(find(checks, "mostly_missing"));
  EXPECT_EQ(find(checks, "mostly_missing")->channel, "yaw_rate");
  telemetry::RecordingSet slow = scout().recordings;
  alter::each_sample(slow, [](signals::Sample& s) {
    if (s.sequence % 10 != 0) s.yaw_rate_rad_s = signals::unmeasured;
  });
  EXPECT_FALSE(find(check_recordings(slow, scout().model), "mostly_missing"));
}

// The robot file differs from the robot in resistance and friction.
TEST(CheckRecordings, ReportsMismatchedRobotFile) {
  robot::RobotModel other = scout().model;
  other.motor.resistance_ohm *= 2;
  for (double& t : other.motor.friction_torque_nm) t /= 2;
  const auto checks = check_recordings(scout().recordings, other);
  ASSERT_TRUE(find(checks, "robot_file"));
  const std::string& says = find(checks, "robot_file")->says;
  EXPECT_NE(says.find("resistance 0.5"), std::string::npos) << says;
  EXPECT_NE(says.find("friction"), std::string::npos) << says;
  EXPECT_TRUE(std::ranges::none_of(checks, &Check::contradicted));
}

TEST(CheckRecordings, ReportsWrongGearRatio) {
  for (const double factor : {0.5, 1.5}) {
    robot::RobotModel other = scout().model;
    other.motor.gear_ratio *= factor;
    const auto checks = check_recordings(scout().recordings, other);
    ASSERT_TRUE(find(checks, "robot_file")) << factor;
    const std::string& says = find(checks, "robot_file")->says;
    const std::size_t at = says.find("a gear_ratio ");
    ASSERT_NE(at, std::string::npos) << says;
    EXPECT_NEAR(std::stod(says.substr(at + 13)), factor, 0.1 * factor) << says;
  }
  robot::RobotModel other = scout().model;
  for (double& t : other.motor.friction_torque_nm) t *= 2;
  const auto checks = check_recordings(scout().recordings, other);
  ASSERT_TRUE(find(checks, "robot_file"));
  EXPECT_EQ(find(checks, "robot_file")->says.find("gear_ratio"), std::string::npos);
}

TEST(CheckRecordings, SplitsRecordingsAtStep) {
  telemetry::RecordingSet set = scout().recordings;
  alter::step(set, {reading::battery_current}, 1.25);
  const auto checks = check_recordings(set, scout().model);
  ASSERT_TRUE(find(checks, "step_between_missions"));
  const Check& step = *find(checks, "step_between_missions");
  EXPECT_EQ(step.first_mission, set.missions.size() / 2);
  EXPECT_NEAR(step.value, 0.25, 0.03);
  EXPECT_NE(step.says.find(set.missions[set.missions.size() / 2].mission_id), std::string::npos);
  EXPECT_LT(step.interval[0], 0.25);
  EXPECT_FALSE(split_at_step(scout().recordings, check_recordings(scout().recordings, scout().model)));
  const auto sides = split_at_step(set, checks);
  ASSERT_TRUE(sides);
  EXPECT_EQ((*sides)[0].missions.size(), set.missions.size() / 2);
  EXPECT_EQ((*sides)[0].missions.size() + (*sides)[1].missions.size(), set.missions.size());
  EXPECT_EQ((*sides)[0].samples + (*sides)[1].samples, set.samples);
  EXPECT_EQ((*sides)[1].missions.front().mission_id, set.missions[*step.first_mission].mission_id);
  // Readings are unchanged before the step and 25 % larger after it.
  for (const std::size_t side : {0u, 1u}) {
    const auto& original = scout().recordings.missions[side == 0 ? 0 : *step.first_mission];
    const auto& kept = (*sides)[side].missions.front();
    EXPECT_EQ((*sides)[side].robot_id, set.robot_id);
    EXPECT_NEAR(kept.samples[200].battery_current_a,
                (side == 0 ? 1 : 1.25) * original.samples[200].battery_current_a, 1e-9);
  }
}

// A robot with battery power and wheel speeds alone.
made::Robot with_power_alone(int missions = 3) {
  made::Robot robot = made::virtual_robot("amr", 21, [&](vr::SimulationSpec& spec) {
    spec.sensors.motor_channels = false;
    spec.missions = missions;
  });
  alter::fill(robot.recordings,
              {reading::yaw_rate, reading::x, reading::y, reading::heading, reading::command_speed,
               reading::command_turn},
              signals::unmeasured);
  return robot;
}

TEST(CheckRecordings, FindsStepByPowerAlone) {
  made::Robot robot = with_power_alone(8);
  alter::step(robot.recordings, {reading::battery_current}, 1.25);
  const auto checks = check_recordings(robot.recordings, robot.model);
  const Check* step = find(checks, "step_between_missions");
  ASSERT_TRUE(step);
  EXPECT_EQ(step->first_mission, 4u);
  EXPECT_TRUE(step->channel.starts_with("battery_")) << step->channel;
}

TEST(CheckRecordings, NamesUnitsByPowerAlone) {
  const made::Robot robot = with_power_alone();
  for (const double factor : {0.01, 0.1, 10.0}) {
    telemetry::RecordingSet set = robot.recordings;
    alter::multiply(set, {reading::battery_current}, factor);
    const auto checks = check_recordings(set, robot.model);
    const Check* check = find(checks, "battery_current_scale");
    ASSERT_TRUE(check) << factor;
    EXPECT_DOUBLE_EQ(check->factor.value_or(0), factor) << check->says;
    EXPECT_FALSE(find(checks, "wheel_velocity_scale")) << factor;
  }
}

// Turning on grip costs several times the power of straight driving, and the file has nothing of it.
TEST(CheckRecordings, NamesUnitsDespiteTurningCosts) {
  const made::Robot robot = with_power_alone();
  for (const double factor : {0.1, 10.0}) {
    telemetry::RecordingSet set = robot.recordings;
    alter::each_sample(set, [&](signals::Sample& s) {
      const double turning = std::fabs(s.wheel_velocity_rad_s[0] - s.wheel_velocity_rad_s[1]);
      s.battery_current_a += 100 * turning / s.battery_voltage_v;
    });
    alter::multiply(set, {reading::battery_current}, factor);
    const auto checks = check_recordings(set, robot.model);
    const Check* check = find(checks, "battery_current_scale");
    ASSERT_TRUE(check) << factor;
    EXPECT_TRUE(check->contradicted) << check->says;
    EXPECT_NEAR(check->value, factor, 0.1 * factor) << check->says;
  }
}

// Friction, mass and a base load that the file does not have are no units.
TEST(CheckRecordings, AcceptsOtherPhysicsAsSound) {
  const made::Robot robot = with_power_alone();
  const auto accepted = [&](const robot::RobotModel& model, double load_w) {
    telemetry::RecordingSet set = robot.recordings;
    alter::each_sample(set, [&](signals::Sample& s) { s.battery_current_a += load_w / s.battery_voltage_v; });
    for (const Check& c : check_recordings(set, model)) EXPECT_FALSE(c.contradicted) << c.says;
  };
  for (const double load_w : {0.0, 300.0, 1000.0}) accepted(robot.model, load_w);
  for (const double factor : {0.15, 0.3, 3.0, 6.0}) {
    robot::RobotModel file = robot.model;
    for (double& friction : file.motor.friction_torque_nm) friction *= factor;
    accepted(file, 0);
    file = robot.model;
    file.mass.chassis_kg *= std::clamp(factor, 0.5, 3.0);
    accepted(file, 0);
  }
}

// The plant delays every electrical channel.
TEST(CheckRecordings, MeasuresElectricalDelay) {
  for (const vr::ShippedRobot& shipped : vr::shipped_robots()) {
    for (const bool motors : {true, false}) {
      for (const double delay_s : {0.0, 0.2}) {
        const made::Robot robot = made::virtual_robot(shipped.kind, 5, [&](vr::SimulationSpec& spec) {
          spec.imperfections.sensor_delay = delay_s;
          spec.sensors.motor_channels = motors;
        });
        SCOPED_TRACE(std::string(shipped.kind) + (motors ? " with" : " without") + " motor channels, " +
                     std::to_string(delay_s));
        const auto checks = check_recordings(robot.recordings, robot.model);
        const Check* check = find(checks, "electrical_delay");
        EXPECT_FALSE(find(checks, "yaw_rate_delay"));
        for (const Check& c : checks) EXPECT_FALSE(c.contradicted) << c.says;
        if (delay_s == 0) {
          EXPECT_FALSE(check);
          continue;
        }
        EXPECT_TRUE(check);
        if (!check) continue;
        EXPECT_NEAR(check->value, delay_s, 0.015);
        EXPECT_EQ(check->channel, motors ? "motor_current" : "battery_current");
      }
    }
  }
}

// The checks of a daemon do not measure delays. Delayed currents are neither reversed nor swapped.
TEST(CheckContradictions, AcceptsDelayedCurrents) {
  for (const vr::ShippedRobot& shipped : vr::shipped_robots()) {
    for (const double delay_s : {0.0, 0.1, 0.2, 0.3}) {
      const made::Robot robot = made::virtual_robot(
          shipped.kind, 7, [&](vr::SimulationSpec& spec) { spec.imperfections.sensor_delay = delay_s; });
      for (const auto& mission : robot.recordings.missions) {
        const Observation seen = observe(mission, robot.model, dynamics::DriveModel(robot.model, {}));
        for (const Check& c : check_contradictions({&seen, 1}, robot.model))
          EXPECT_FALSE(c.contradicted) << shipped.kind << ' ' << delay_s << ": " << c.says;
      }
    }
  }
}

// Recordings of a carrier with wheel speeds and only these other channels.
telemetry::RecordingSet carrier_with(const std::vector<std::size_t>& readings) {
  static const made::Robot robot = made::virtual_robot("amr", 33);
  telemetry::RecordingSet set = robot.recordings;
  for (std::size_t k = reading::motor_voltage; k < reading_count; ++k) {
    if (std::ranges::count(readings, k) == 0) alter::fill(set, {k}, signals::unmeasured);
  }
  return set;
}

robot::RobotModel carrier() {
  return made::virtual_robot("amr", 33, [](vr::SimulationSpec& s) { s.missions = 1; }).model;
}

// Constant wheel speeds contradict the channels that measure motion. Without such a channel they are valid.
TEST(CheckContradictions, ReportsConstantWheelSpeeds) {
  using namespace reading;
  const robot::RobotModel model = carrier();
  const std::vector<std::vector<std::size_t>> witnesses{
      {yaw_rate},
      {x, y, heading},
      {motor_voltage, motor_voltage + 1, motor_current, motor_current + 1},
      {battery_voltage, battery_current, command_speed, command_turn}};
  for (const double value : {0.0, 5.0}) {
    for (const auto& witness : witnesses) {
      telemetry::RecordingSet set = carrier_with(witness);
      alter::fill(set, {0, 1}, value);
      const auto checks = check_recordings(set, model);
      const Check* check = find(checks, value == 0 ? "dead_channel" : "constant_channel");
      ASSERT_TRUE(check) << witness.front() << ' ' << value;
      EXPECT_EQ(check->channel, "wheel_velocity");
      EXPECT_TRUE(check->contradicted);
      EXPECT_NE(check->says.find("moves by its "), std::string::npos) << check->says;
    }
  }
  // Constant speed over rough ground: battery readings alone are no contradiction.
  telemetry::RecordingSet steady = carrier_with({battery_voltage, battery_current});
  alter::fill(steady, {0, 1}, 5);
  for (const Check& c : check_recordings(steady, model)) EXPECT_FALSE(c.contradicted) << c.says;
  // The robot is at rest without commands.
  telemetry::RecordingSet standing = carrier_with({yaw_rate, x, y, heading});
  alter::fill(standing, {0, 1}, 0);
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1);
  alter::each_sample(standing, [&](signals::Sample& s) {
    s.yaw_rate_rad_s = 0.02 + 0.01 * noise(random);
    s.pose = {3 + 0.02 * noise(random), 4 + 0.02 * noise(random), 0.01 * noise(random)};
  });
  EXPECT_TRUE(check_recordings(standing, model).empty());
}

// Expects one check per mission in a daemon, for a carrier with these channels only.
void told_of_one(const std::vector<std::size_t>& readings, std::string_view id, std::string_view channel,
                 const std::function<void(telemetry::RecordingSet&)>& mistake) {
  telemetry::RecordingSet set = carrier_with(readings);
  const robot::RobotModel model = carrier();
  for (const bool wrong : {false, true}) {
    if (wrong) mistake(set);
    for (const auto& mission : set.missions) {
      const Observation seen = observe(mission, model, dynamics::DriveModel(model, {}));
      const auto checks = check_contradictions({&seen, 1}, model);
      ASSERT_EQ(checks.size(), wrong ? 1u : 0u) << mission.mission_id << ' ' << id;
      if (!wrong) continue;
      EXPECT_EQ(checks[0].id, id);
      EXPECT_EQ(checks[0].channel, channel);
      EXPECT_TRUE(checks[0].contradicted);
    }
  }
}

TEST(CheckContradictions, FindsReversedWheelFromWitness) {
  using namespace reading;
  const auto reversed = [](telemetry::RecordingSet& set) { alter::multiply(set, {1}, -1); };
  for (const std::vector<std::size_t>& others :
       {std::vector<std::size_t>{yaw_rate}, {command_speed, command_turn}}) {
    std::vector<std::size_t> readings{battery_voltage, battery_current};
    readings.insert(readings.end(), others.begin(), others.end());
    told_of_one(readings, "wheel_velocity_reversed", "wheel_velocity.left", reversed);
  }
}

TEST(CheckContradictions, ReportsSwappedBatteryReadings) {
  using namespace reading;
  told_of_one({battery_voltage, battery_current}, "battery_current_scale", "battery_current",
              [](telemetry::RecordingSet& set) {
                alter::each_sample(set,
                                   [](signals::Sample& s) { s.battery_current_a *= s.battery_voltage_v; });
              });
  told_of_one({battery_voltage, battery_current}, "battery_swapped", "battery_voltage, battery_current",
              [](telemetry::RecordingSet& set) {
                alter::each_sample(
                    set, [](signals::Sample& s) { std::swap(s.battery_voltage_v, s.battery_current_a); });
              });
}

// With swapped wheels the voltages resemble voltages without signs.
TEST(CheckContradictions, SeparatesSwappedWheelsFromSigns) {
  using namespace reading;
  told_of_one({motor_voltage, motor_voltage + 1, motor_current, motor_current + 1},
              "wheel_velocity_sides_swapped", "wheel_velocity",
              [](telemetry::RecordingSet& set) { alter::swap_sides(set, {0}); });
}

// A descent with net regeneration: the robot draws power at rest, or its pitch is measured.
TEST(CheckContradictions, AcceptsRegenerationOnDescent) {
  robot::RobotModel model = carrier();
  for (const bool pitch : {false, true}) {
    const telemetry::Recording mission = made::mission(90, 20, [&](double t, signals::Sample& s) {
      const made::Motion m = made::motion(t);
      s.wheel_velocity_rad_s = m.speed;
      const double speed = 0.5 * model.kinematics.wheel_radius_m * (m.speed[0] + m.speed[1]);
      s.battery_voltage_v = model.battery.nominal_voltage_v + 0.01 * std::sin(17 * t);
      s.battery_current_a = (20 - 60 * speed) / s.battery_voltage_v;
      if (!pitch) return;
      s.pitch_rad = -0.2;
      // Regeneration only, without a load at rest.
      s.battery_current_a = -60 * speed / s.battery_voltage_v;
    });
    const Observation seen = observe(mission, model, dynamics::DriveModel(model, {}));
    for (const Check& c : check_contradictions({&seen, 1}, model)) EXPECT_FALSE(c.contradicted) << c.says;
  }
}

// Braking charges the battery and raises its voltage, which a current without a sign contradicts.
TEST(CheckContradictions, FindsRectifiedBatteryCurrent) {
  robot::RobotModel model = carrier();
  // Share of the rise of voltage while charging; half of it is not that of a sign. A load at rest that
  // exceeds the braking power never lets the battery be charged. Speeds in another unit do not tell when it
  // is.
  for (const auto& [positive, share, load_w, unit] : {std::tuple{false, 1.0, 0.0, 1.0},
                                                      {true, 1.0, 0.0, 1.0},
                                                      {true, 0.5, 0.0, 1.0},
                                                      {true, 1.0, 1000.0, 1.0},
                                                      {true, 1.0, 300.0, 9.55}}) {
    model.idle_power_w = 2 + load_w;
    const bool rectified = positive && share == 1 && load_w == 0 && unit == 1;
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise_v(0, 0.01);
    const telemetry::Recording mission = made::mission(240, 20, [&](double t, signals::Sample& s) {
      const made::Motion m = made::motion(t);
      s.wheel_velocity_rad_s = {unit * m.speed[0], unit * m.speed[1]};
      const double radius_m = model.kinematics.wheel_radius_m;
      const double speed = 0.5 * radius_m * (m.speed[0] + m.speed[1]);
      const double slope = 0.5 * radius_m * (m.slope[0] + m.slope[1]);
      s.payload_kg = 300;
      const double current_a = (2 + (20 + model.total_mass_kg(s.payload_kg) * slope) * speed) / 24;
      s.battery_voltage_v = 24 - 0.1 * current_a * (current_a < 0 ? share : 1) + noise_v(random);
      s.battery_current_a = (positive ? std::fabs(current_a) : current_a) + load_w / 24;
    });
    const Observation seen = observe(mission, model, dynamics::DriveModel(model, {}));
    const auto checks = check_contradictions({&seen, 1}, model);
    const Check* found = find(checks, "battery_current_unsigned");
    ASSERT_EQ(found != nullptr, rectified);
    EXPECT_EQ(std::ranges::any_of(checks, &Check::contradicted), rectified || unit != 1)
        << checks.front().says;
    EXPECT_NEAR(rectified ? found->value : 1, 1, 0.1);
  }
}

// Only the battery's readings are delayed; the motors are measured too.
TEST(CheckRecordings, MeasuresBatteryDelayAgainstMotors) {
  static const made::Robot robot = made::virtual_robot("amr", 33);
  for (const double delay_s : {0.0, 0.2, 0.5}) {
    telemetry::RecordingSet set = robot.recordings;
    alter::delay(set, {reading::battery_voltage, reading::battery_current}, delay_s);
    const auto checks = check_recordings(set, robot.model);
    const Check* check = find(checks, "electrical_delay");
    ASSERT_EQ(check != nullptr, delay_s > 0) << delay_s;
    if (check == nullptr) continue;
    EXPECT_EQ(check->channel, "battery_current");
    EXPECT_NEAR(check->value, delay_s, 0.03);
  }
}

// One sample at a time, mission after mission, as in a daemon.
TEST(Observer, MatchesWholeRecording) {
  for (const double factor : {1, -1}) {
    telemetry::RecordingSet set = scout().recordings;
    alter::multiply(set, {reading::battery_current}, factor);
    Observer observer(scout().model, dynamics::DriveModel(scout().model, {}));
    std::vector<Observation> observations;
    for (const auto& mission : set.missions) {
      observer.begin(mission.mission_id, mission.payload_kg);
      for (const auto& sample : mission.samples) observer.add(sample);
      observations.push_back(observer.finish());
    }
    const auto online = check_contradictions(observations, scout().model);
    const auto offline = check_recordings(set, scout().model);
    ASSERT_EQ(online.size(), factor < 0 ? 1u : 0u);
    ASSERT_EQ(offline.size(), online.size());
    if (factor < 0) {
      EXPECT_EQ(online[0].says, offline[0].says);
    }
  }
}

TEST(Observer, CountsSpikesOfLargeValues) {
  const robot::RobotModel model = carrier();
  const double fast = model.limits.speed_m_s / model.kinematics.wheel_radius_m;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0, 0.01);
  telemetry::Recording mission = made::mission(20, 50, [&](double t, signals::Sample& s) {
    for (double& w : s.wheel_velocity_rad_s) w = (t < 10 ? 0.0 : 0.8 * fast) + normal(random);
  });
  const auto spikes = [&] {
    return observe(mission, model, dynamics::DriveModel(model, {})).spikes[reading::wheel_velocity];
  };
  EXPECT_EQ(spikes(), 0u);
  for (const std::size_t at : {600u, 700u, 801u}) mission.samples[at].wheel_velocity_rad_s[0] = 0;
  EXPECT_EQ(spikes(), 3u);
}

}  // namespace
}  // namespace joulecast::plausibility
