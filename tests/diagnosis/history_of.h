#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "client/virtual_robot/fleet.h"
#include "dynamics/drive_model.h"
#include "history/writer.h"
#include "server/diagnosis/model_adoption.h"
#include "signals/sample.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::testing {

inline std::vector<history::MissionKey> tested_on(const server::Adoption& adoption) {
  std::vector<history::MissionKey> keys;
  for (const energy::RunComparison& run : adoption.test.runs) keys.push_back(run.id.value());
  return keys;
}

inline robot::RobotModel nomad_with_friction(double factor) {
  robot::RobotModel robot = nomad();
  for (double& torque : robot.motor.friction_torque_nm) torque *= factor;
  return robot;
}

// Puts a declared mission of `samples` samples at 50 Hz into the harness's history, driven by a robot that
// follows the model `truth`, with noise on speeds, currents and voltages. Returns its key. The robot may
// first rest at a charger for `charging_samples` samples.
inline history::MissionKey drive(PipelineHarness& harness, const robot::RobotModel& truth, int number,
                                 int samples = 1500, int charging_samples = 0) {
  const auto model = *dynamics::drive_model(truth);
  std::mt19937_64 random(static_cast<std::uint64_t>(number));
  std::normal_distribution<double> noise(0, 0.05);
  const std::int64_t start_us = 1'750'000'000'000'000 + number * 3'600'000'000LL;
  const std::string id = "m" + std::to_string(number);
  const auto event = [&](signals::MissionPhase phase, std::int64_t utime_us) {
    harness.pipeline->handle({truth.robot_id, signals::MissionEvent{utime_us, id, phase, 0, ""}, utime_us});
  };
  event(signals::MissionPhase::started, start_us - 1000);
  const double swing = 0.3 + 0.05 * (number % 5);
  for (int k = 0; k < samples; ++k) {
    const bool charges = k < charging_samples;
    const double t = 0.02 * k;
    dynamics::Instant at;
    const double speed = 4 + 3 * std::sin(swing * t), turn = std::sin(0.7 * swing * t);
    at.wheel_speed_rad_s = {speed + turn, speed - turn};
    const double slope = 3 * swing * std::cos(swing * t), bend = 0.7 * swing * std::cos(0.7 * swing * t);
    at.wheel_acceleration_rad_s2 = {slope + bend, slope - bend};
    const auto flow = model.flow(at);
    signals::Sample s;
    s.utime_us = start_us + 20'000LL * k;
    s.sequence = number * 1'000'000LL + k;
    s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    for (std::size_t side : {0u, 1u}) {
      s.wheel_velocity_rad_s[side] += 0.1 * noise(random);
      s.motor_current_a[side] = flow.current_a[side] + noise(random);
      s.motor_voltage_v[side] = flow.voltage_v[side] + noise(random);
    }
    s.battery_voltage_v = 24;
    s.battery_current_a = flow.battery_power_w / 24 + noise(random);
    s.payload_kg = 0;
    if (charges) {
      s.wheel_velocity_rad_s = s.motor_current_a = s.motor_voltage_v = {0, 0};
      s.battery_current_a = -3;
    }
    harness.pipeline->handle({truth.robot_id, s, s.utime_us});
  }
  event(signals::MissionPhase::finished, start_us + 20'000LL * samples);
  return harness.missions().back().key;
}

// Missions of the project's plant, which shares no physics with the model, as the robot would have published
// them from `start_us` on.
inline void play(PipelineHarness& harness, std::string_view robot_json,
                 const std::vector<virtual_robot::EffectStrength>& effects, int missions, std::uint64_t seed,
                 std::int64_t start_us) {
  virtual_robot::SimulationSpec spec;
  spec.robot = *virtual_robot::parse_robot(std::string(robot_json));
  spec.imperfections = *virtual_robot::make_imperfections(effects);
  spec.missions = missions;
  const virtual_robot::Simulation run = virtual_robot::simulate_missions(spec, seed);
  const std::int64_t shift = start_us - run.events.front().utime_us;
  std::size_t next = 0;
  for (signals::MissionEvent event : run.events) {
    if (event.phase != signals::MissionPhase::started) {
      for (; next < run.samples.size() && run.samples[next].utime_us <= event.utime_us; ++next) {
        signals::Sample sample = run.samples[next];
        sample.utime_us += shift;
        harness.pipeline->handle({spec.robot.robot_id, sample, sample.utime_us});
      }
    }
    event.utime_us += shift;
    event.mission_id += "-" + std::to_string(seed);
    harness.pipeline->handle({spec.robot.robot_id, event, event.utime_us});
  }
}

}  // namespace joulecast::testing
