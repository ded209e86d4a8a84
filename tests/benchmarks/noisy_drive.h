#pragma once

#include <cmath>
#include <cstdint>

#include "robot/robot_model.h"
#include "signals/sample.h"
#include "tests/support/sample_robots.h"

namespace joulecast::benchmarks {

// A drive with noise in every channel, so that no interval is trivially smooth.
class NoisyDrive {
 public:
  // `t` robot seconds since its start; utime and sequence are left to the caller.
  signals::Sample at(double t) {
    signals::Sample s;
    s.wheel_velocity_rad_s = {4 + 3 * std::sin(0.5 * t) + 0.02 * noise(),
                              4 + 3 * std::sin(0.55 * t) + 0.02 * noise()};
    s.motor_voltage_v = {8 + 5 * std::sin(0.5 * t) + 0.1 * noise(),
                         8 + 5 * std::sin(0.55 * t) + 0.1 * noise()};
    s.motor_current_a = {0.4 + std::cos(0.5 * t) + 0.2 * noise(), 0.4 + std::cos(0.55 * t) + 0.2 * noise()};
    s.battery_voltage_v = 24 + 0.05 * noise();
    s.battery_current_a = 1 + std::cos(0.5 * t) + 0.1 * noise();
    s.yaw_rate_rad_s = 0.01 * noise();
    s.pose = {std::sin(0.1 * t), std::cos(0.1 * t), 0.1 * t};
    s.payload_kg = 5;
    return s;
  }

 private:
  double noise() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11) * 0x1p-53 - 0.5;
  }
  std::uint64_t state_ = 1;
};

inline robot::RobotModel robot_named(const std::string& id) {
  robot::RobotModel robot = testing::nomad();
  robot.robot_id = id;
  return robot;
}

}  // namespace joulecast::benchmarks
