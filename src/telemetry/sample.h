#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>

namespace joulecast::telemetry {

inline constexpr double unmeasured = std::numeric_limits<double>::quiet_NaN();

// One sample of robot_telemetry_t, free of LCM. Units and signs as in lcmtypes/robot_telemetry_t.lcm;
// sides: [0] right, [1] left; NaN = not measured.
struct Sample {
  std::int64_t utime_us = 0;
  std::int64_t sequence = 0;
  std::array<double, 2> wheel_velocity_rad_s{};
  std::array<double, 2> motor_voltage_v{unmeasured, unmeasured};
  std::array<double, 2> motor_current_a{unmeasured, unmeasured};
  double battery_voltage_v = unmeasured;
  double battery_current_a = unmeasured;
  std::array<double, 2> velocity_command{unmeasured, unmeasured};  // m/s, rad/s
  double yaw_rate_rad_s = unmeasured;
  double pitch_rad = unmeasured;
  std::array<double, 3> pose{unmeasured, unmeasured, unmeasured};  // x m, y m, heading rad
  std::array<double, 2> motor_temperature_c{unmeasured, unmeasured};
  double payload_kg = unmeasured;
};

enum class MissionPhase : std::int8_t { started = 1, finished = 2, aborted = 3 };

// mission_event_t, free of LCM.
struct MissionEvent {
  std::int64_t utime_us = 0;
  std::string mission_id;
  MissionPhase phase = MissionPhase::started;
  double payload_kg = unmeasured;
  std::string note;
};

}  // namespace joulecast::telemetry
