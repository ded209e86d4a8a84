#pragma once

#include <cmath>
#include <random>
#include <string>

#include "dynamics/drive_model.h"
#include "history/writer.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::testing {

inline robot::RobotModel nomad_with_friction(double factor) {
  robot::RobotModel robot = nomad();
  for (double& torque : robot.motor.friction_torque_nm) torque *= factor;
  return robot;
}

// Puts a declared mission of `samples` samples at 50 Hz into the harness's history, driven by a robot that
// behaves as `truth` says, with noise on the battery current. Returns its key.
inline history::MissionKey drive(PipelineHarness& harness, const robot::RobotModel& truth, int number,
                                 int samples = 1500) {
  const auto model = *dynamics::drive_model(truth);
  std::mt19937_64 random(static_cast<std::uint64_t>(number));
  std::normal_distribution<double> noise(0, 0.05);
  const std::int64_t start_us = 1'750'000'000'000'000 + number * 3'600'000'000LL;
  const std::string id = "m" + std::to_string(number);
  const auto event = [&](telemetry::MissionPhase phase, std::int64_t utime_us) {
    harness.pipeline->handle({truth.robot_id, telemetry::MissionEvent{utime_us, id, phase, 0, ""}, utime_us});
  };
  event(telemetry::MissionPhase::started, start_us - 1000);
  const double swing = 0.3 + 0.05 * (number % 5);
  for (int k = 0; k < samples; ++k) {
    const double t = 0.02 * k;
    dynamics::Instant at;
    const double speed = 4 + 3 * std::sin(swing * t), turn = std::sin(0.7 * swing * t);
    at.wheel_speed_rad_s = {speed + turn, speed - turn};
    const double slope = 3 * swing * std::cos(swing * t), bend = 0.7 * swing * std::cos(0.7 * swing * t);
    at.wheel_acceleration_rad_s2 = {slope + bend, slope - bend};
    const auto flow = model.flow(at);
    telemetry::Sample s;
    s.utime_us = start_us + 20'000LL * k;
    s.sequence = number * 1'000'000LL + k;
    s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    s.motor_current_a = flow.current_a;
    s.motor_voltage_v = flow.voltage_v;
    s.battery_voltage_v = 24;
    s.battery_current_a = flow.battery_power_w / 24 + noise(random);
    s.payload_kg = 0;
    harness.pipeline->handle({truth.robot_id, s, s.utime_us});
  }
  event(telemetry::MissionPhase::finished, start_us + 20'000LL * samples);
  return harness.missions().back().key;
}

}  // namespace joulecast::testing
