#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/virtual_robot/fleet.h"
#include "robot/robot_file.h"
#include "signals/sample.h"
#include "telemetry/log_recordings.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::made {

namespace vr = virtual_robot;

struct Robot {
  robot::RobotModel model;
  telemetry::RecordingSet recordings;
};

// Missions of a shipped robot's plant, which shares no physics with the model.
inline Robot virtual_robot(std::string_view kind, std::uint64_t seed,
                           const std::function<void(vr::SimulationSpec&)>& change = {}) {
  vr::SimulationSpec spec;
  Robot robot;
  for (const vr::ShippedRobot& shipped : vr::shipped_robots()) {
    if (shipped.kind != kind) continue;
    spec.robot = *vr::parse_robot(std::string(shipped.json_text));
    robot.model = *robot::parse_robot(shipped.json_text);
  }
  spec.missions = 6;
  spec.script.duration_s = 40;
  spec.rate_hz = 25;
  if (change) change(spec);
  const vr::Simulation run = vr::simulate_missions(spec, seed);
  std::vector<telemetry::Recording> missions;
  std::size_t next = 0;
  for (const signals::MissionEvent& event : run.events) {
    if (event.phase == signals::MissionPhase::started) {
      missions.push_back({robot.model.robot_id, event.mission_id, event.payload_kg, {}});
      continue;
    }
    while (next < run.samples.size() && run.samples[next].utime_us <= event.utime_us) {
      missions.back().samples.push_back(run.samples[next++]);
    }
  }
  robot.recordings = *telemetry::make_recording_set(robot.model.robot_id, std::move(missions));
  return robot;
}

// A mission with samples given as a function of time [s].
inline telemetry::Recording mission(double length_s, double rate_hz,
                                    const std::function<void(double, signals::Sample&)>& fill) {
  telemetry::Recording recording;
  recording.mission_id = "made";
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(length_s * rate_hz); ++k) {
    signals::Sample s;
    const double t = static_cast<double>(k) / rate_hz;
    s.utime_us = 1'700'000'000'000'000 + static_cast<std::int64_t>(std::llround(1e6 * t));
    s.sequence = k;
    fill(t, s);
    recording.samples.push_back(s);
  }
  return recording;
}

// Wheel speeds of a drive with starts, halts, curves and several speeds, and their slopes [rad/s, rad/s^2].
struct Motion {
  std::array<double, 2> speed{}, slope{};
};

// A trapezoid from 0 to 1 and back once per period [s], and its slope.
inline std::array<double, 2> trapezoid(double t, double period_s, double ramp_s, double hold_s) {
  const double at = t - period_s * std::floor(t / period_s);
  if (at < ramp_s) return {at / ramp_s, 1 / ramp_s};
  if (at < ramp_s + hold_s) return {1, 0};
  if (at < 2 * ramp_s + hold_s) return {1 - (at - ramp_s - hold_s) / ramp_s, -1 / ramp_s};
  return {0, 0};
}

inline Motion motion(double t) {
  const auto drive = trapezoid(t, 11, 1.5, 5), faster = trapezoid(t, 37, 2, 9),
             bend = trapezoid(t, 14.3, 0.8, 3);
  const double side = std::fmod(std::floor(t / 14.3), 2) == 0 ? 1.5 : -1.2;
  const std::array<double, 2> common{3 * drive[0] + 3 * faster[0], 3 * drive[1] + 3 * faster[1]};
  return {{common[0] + side * bend[0], common[0] - side * bend[0]},
          {common[1] + side * bend[1], common[1] - side * bend[1]}};
}

}  // namespace joulecast::made
