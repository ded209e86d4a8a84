#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::trial::motion {

// The robot at one instant at which its battery current was refreshed. Sides: [0] right, [1] left.
struct Instant {
  std::size_t sample = 0;           // of its mission
  double t_s = 0;                   // since the mission began
  double driven_s = 0;              // since the first mission began, without the time between missions
  double travelled_m = 0;           // path length since the first mission began
  double x_m = 0, y_m = 0;          // by the wheels, from where the mission began
  std::array<double, 2> rim_m_s{};  // speed of the wheels' rims
  double speed_m_s = 0, acceleration_m_s2 = 0;
  double yaw_rate_rad_s = 0, yaw_acceleration_rad_s2 = 0;  // by the wheels, positive to the left
  double voltage_v = 0, current_a = 0;                     // of the battery, as recorded

  double power_w() const { return voltage_v * current_a; }
};

// How the battery was recorded.
struct BatteryChannels {
  double period_s = 0;                            // between refreshed currents; those between two are held
  double current_step_a = 0, voltage_step_v = 0;  // between values that differ; 0: too fine to detect
  double resistance_ohm =
      0;  // by which the voltage falls with the current, in addition to its fall with the charge drawn
};

// Recorded missions, and the instants of each at which battery power was measured.
struct MotionLog {
  std::string name;
  robot::RobotModel kinematics;  // wheels, limits and battery from the robot file next to the log
  bool own_kinematics = false;   // false: nothing was given, neutral numbers
  BatteryChannels battery;
  std::vector<telemetry::Recording> missions;
  std::vector<std::vector<Instant>> instants;  // of each mission

  std::vector<Instant> all_instants() const;
};

// The kinematics of a log without a robot file: wheels of 0.1 m, 0.5 m apart.
[[nodiscard]] robot::RobotModel neutral_kinematics();

// The instants of measured battery power, with a current refreshed every `period_s`. Speeds and accelerations
// are straight lines through the wheel speeds within 0.4 s, or within two samples where those are further
// apart. Missions without a measured instant stay empty.
[[nodiscard]] std::vector<std::vector<Instant>> instants_of(std::span<const telemetry::Recording> missions,
                                                            const robot::Kinematics& kinematics,
                                                            double period_s);

[[nodiscard]] BatteryChannels battery_channels_of(std::span<const telemetry::Recording> missions);

// Reads a log and the robot file of the same name next to it. Fault::infeasible, with a sentence, if it
// contains too little motion with battery power.
[[nodiscard]] Result<MotionLog> read_motion_log(const std::filesystem::path& path);

}  // namespace joulecast::trial::motion
