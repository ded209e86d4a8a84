#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "client/virtual_robot/fleet.h"
#include "gap/posterior/data.h"
#include "gap/posterior/explain_recordings.h"
#include "robot/robot_file.h"
#include "telemetry/log_recordings.h"

namespace joulecast::gap::posterior::made {

// Drives of the shipped nomad. Battery power is the model's at each sample, with planted effects, a load and
// white noise. Motors are not measured.
struct Drives {
  explicit Drives(unsigned with_seed) : seed(with_seed) {
    for (const virtual_robot::ShippedRobot& shipped : virtual_robot::shipped_robots()) {
      if (shipped.kind == "nomad") robot = *robot::parse_robot(shipped.json_text);
    }
  }

  // Wheel speed [rad/s] with starts, stops, acceleration and turns.
  static double speed(double t, std::size_t side) {
    using std::numbers::pi;
    const double goes = 0.5 + 0.5 * std::tanh(5 * std::sin(2 * pi * t / 31) + 3);
    const double turn = std::max(0.0, std::sin(2 * pi * t / 19)) * (side == 0 ? 1 : -1);
    return goes * (5 + 3 * std::sin(2 * pi * t / 13) + 1.5 * std::sin(2 * pi * t / 5.3) + turn);
  }

  telemetry::RecordingSet recordings() const {
    constexpr double step_s = 0.05, mission_s = 80, volts = 24, h = 1e-3;
    const dynamics::DriveModel model(robot, planted);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, noise_w);
    std::vector<telemetry::Recording> missions;
    for (int m = 0; m < 4; ++m) {
      telemetry::Recording mission;
      mission.robot_id = robot.robot_id;
      mission.mission_id = "m" + std::to_string(m);
      mission.payload_kg = 0;
      for (int k = 0; k < static_cast<int>(mission_s / step_s); ++k) {
        const double t = m * mission_s + k * step_s;
        signals::Sample s;
        s.utime_us = 1'700'000'000'000'000 + std::llround(1e6 * (t + 100 * m));
        s.sequence = k;
        Window w;
        for (const std::size_t side : {0u, 1u}) {
          s.wheel_velocity_rad_s[side] = w.speed_rad_s[side] = speed(t, side);
          w.acceleration_rad_s2[side] = (speed(t + h, side) - speed(t - h, side)) / (2 * h);
        }
        w.battery_voltage_v = volts;
        s.battery_voltage_v = volts;
        s.battery_current_a = (metered_powers(model, w).battery_w + load_w(t) + noise(random)) / volts;
        mission.samples.push_back(s);
      }
      missions.push_back(std::move(mission));
    }
    return *telemetry::make_recording_set(robot.robot_id, std::move(missions));
  }

  robot::RobotModel robot;
  std::vector<dynamics::ActiveEffect> planted;
  std::function<double(double)> load_w = [](double) { return 0.0; };
  double noise_w = 1;
  unsigned seed;
};

}  // namespace joulecast::gap::posterior::made

namespace joulecast::gap::posterior {

inline Result<Explained> explain_recordings(const telemetry::RecordingSet& recordings,
                                            const robot::RobotModel& robot) {
  const auto fit = fit_missions(recordings.missions, robot);
  if (!fit) return tl::unexpected(fit.error());
  return explain(**fit);
}

}  // namespace joulecast::gap::posterior
