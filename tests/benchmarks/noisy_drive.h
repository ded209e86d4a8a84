#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "dynamics/drive_model.h"
#include "signals/sample.h"
#include "tests/support/sample_robots.h"

namespace joulecast::benchmarks {

// A drive of the robot nomad with noise in every channel, so that no interval is trivially smooth. Apart from
// noise the channels agree: motors and battery follow the drive model, the pose follows the wheels.
class NoisyDrive {
 public:
  explicit NoisyDrive(double noise_scale = 1) : noise_scale_(noise_scale) {}

  // `t` is the time since the start [s] and increases from call to call; the caller sets utime and sequence.
  signals::Sample at(double t) {
    dynamics::Instant motion;
    motion.wheel_speed_rad_s = {4 + 3 * std::sin(0.5 * t), 4 + 3 * std::sin(0.55 * t)};
    motion.wheel_acceleration_rad_s2 = {1.5 * std::cos(0.5 * t), 1.65 * std::cos(0.55 * t)};
    motion.payload_kg = 5;
    const auto flow = model_.flow(motion);
    const auto body = dynamics::body_of_wheels(model_.parameters(), motion.wheel_speed_rad_s,
                                               motion.wheel_acceleration_rad_s2);
    const double turned = body.yaw_rate_rad_s * (t - t_), way = body.speed_m_s * (t - t_);
    pose_[0] += way * std::cos(pose_[2] + 0.5 * turned);
    pose_[1] += way * std::sin(pose_[2] + 0.5 * turned);
    pose_[2] += turned;
    t_ = t;

    signals::Sample s;
    for (std::size_t side : {0u, 1u}) {
      s.wheel_velocity_rad_s[side] = motion.wheel_speed_rad_s[side] + 0.02 * noise();
      s.motor_voltage_v[side] = flow.voltage_v[side] + 0.1 * noise();
      s.motor_current_a[side] = flow.current_a[side] + 0.2 * noise();
    }
    s.battery_voltage_v = 24 + 0.05 * noise();
    s.battery_current_a = flow.battery_power_w / 24 + 0.1 * noise();
    s.yaw_rate_rad_s = body.yaw_rate_rad_s + 0.01 * noise();
    s.pose = pose_;
    s.payload_kg = motion.payload_kg;
    return s;
  }

 private:
  double noise() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return noise_scale_ * (static_cast<double>(state_ >> 11) * 0x1p-53 - 0.5);
  }
  dynamics::DriveModel model_ = *dynamics::drive_model(testing::nomad());
  std::array<double, 3> pose_{};
  double t_ = 0, noise_scale_;
  std::uint64_t state_ = 1;
};

inline robot::RobotModel robot_named(const std::string& id) {
  robot::RobotModel robot = testing::nomad();
  robot.robot_id = id;
  return robot;
}

}  // namespace joulecast::benchmarks
