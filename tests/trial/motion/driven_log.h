#pragma once

#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "client/virtual_robot/rng.h"
#include "robot/robot_file.h"
#include "telemetry/event_log.h"
#include "telemetry/recording.h"
#include "tests/study/trial/motion/motion_log.h"

namespace joulecast::trial::motion {

// Wheels and battery of a robot of 100 kg.
inline robot::RobotModel driven_robot() {
  robot::RobotModel robot = neutral_kinematics();
  robot.robot_id = "driven";
  robot.mass = {90, 5, 12, 0.02};
  robot.motor.resistance_ohm = 0.1;
  robot.motor.torque_constant_nm_a = robot.motor.voltage_constant_v_s_rad = 1;
  robot.battery.nominal_voltage_v = 48;
  robot.limits = {10, 2, 2, 100, 0};
  return robot;
}

// Legs at changing speeds, turns to both sides and halts, with 10 samples per second. The battery current is
// read every `hold` samples and held; power is `power_w` of speed, acceleration and yaw rate.
inline std::vector<telemetry::Recording> driven_missions(
    std::size_t missions, double duration_s, std::size_t hold,
    const std::function<double(double v, double a, double yaw)>& power_w, double top_m_s = 6) {
  virtual_robot::Rng rng(5);
  std::vector<telemetry::Recording> made;
  const robot::Kinematics k = neutral_kinematics().kinematics;
  for (std::size_t m = 0; m < missions; ++m) {
    telemetry::Recording mission;
    mission.robot_id = "driven";
    mission.mission_id = "m" + std::to_string(m);
    double v = 0, yaw = 0, goal = 0, turn = 0, held_a = 0;
    for (std::size_t n = 0; n < static_cast<std::size_t>(duration_s * 10); ++n) {
      if (n % 60 == 0) {
        goal = rng.chance(0.3) ? 0 : rng.uniform(0.2, 1) * top_m_s;
        turn = rng.chance(0.5) ? 0 : rng.uniform(-1, 1);
      }
      const double a = std::clamp(goal - v, -1.0, 1.0);
      v += 0.1 * a;
      yaw += 0.1 * std::clamp(turn - yaw, -0.5, 0.5);
      signals::Sample s;
      s.utime_us = 1'700'000'000'000'000 + static_cast<std::int64_t>(m) * 3'600'000'000 +
                   static_cast<std::int64_t>(n) * 100'000;
      s.sequence = static_cast<std::int64_t>(n);
      s.wheel_velocity_rad_s = {(v + k.half_track_m * yaw) / k.wheel_radius_m,
                                (v - k.half_track_m * yaw) / k.wheel_radius_m};
      if (n % hold == 0) held_a = power_w(v, a, yaw) / 48;
      s.battery_voltage_v = 48;
      s.battery_current_a = held_a;
      mission.samples.push_back(s);
    }
    made.push_back(std::move(mission));
  }
  return made;
}

inline MotionLog motion_log_of(std::vector<telemetry::Recording> missions) {
  MotionLog log;
  log.name = "driven";
  log.kinematics = driven_robot();
  log.own_kinematics = true;
  log.missions = std::move(missions);
  log.battery = battery_channels_of(log.missions);
  log.instants = instants_of(log.missions, log.kinematics.kinematics, log.battery.period_s);
  return log;
}

// A folder with one such log, with noisy power, and its robot file.
inline void write_driven_folder(const std::filesystem::path& folder) {
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  virtual_robot::Rng noise(7);
  double wander_w = 0;
  const auto missions = driven_missions(3, 120, 1, [&](double v, double a, double yaw) {
    wander_w = 0.95 * wander_w + 6 * noise.normal();
    return 60 + 30 * std::fabs(v) + 40 * std::fabs(yaw) + 100 * v * a + 0.6 * std::pow(std::fabs(v), 3) +
           wander_w;
  });
  auto log = telemetry::EventLogWriter::create((folder / "driven.lcmlog").string());
  for (const auto& mission : missions) (void)telemetry::write_recording(*log, mission);
  (void)log->close();
  FILE* file = std::fopen((folder / "driven.json").c_str(), "w");
  const std::string text = robot::to_json_text(driven_robot());
  std::fwrite(text.data(), 1, text.size(), file);
  std::fclose(file);
}

}  // namespace joulecast::trial::motion
