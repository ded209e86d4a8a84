#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "signals/sample.h"

namespace joulecast::plausibility {

// Names of the numbers of a sample (signals::numbers_of), as used in checks: "wheel_velocity.right".
inline constexpr std::size_t reading_count = signals::sample_numbers;
inline const std::array<std::string, reading_count> reading_names = [] {
  std::array<std::string, reading_count> names;
  for (std::size_t k = 0; k < reading_count; ++k) {
    const auto& [name, part, key] = signals::sample_fields[k];
    names[k] = std::string(name).append(part.empty() ? "" : ".").append(part);
  }
  return names;
}();

inline constexpr std::array side_name{"right", "left"};

// Indices in that order; of pairs, the right side.
namespace reading {
inline constexpr std::size_t wheel_velocity = 0, motor_voltage = 2, motor_current = 4, battery_voltage = 6,
                             battery_current = 7, command_speed = 8, command_turn = 9, yaw_rate = 10,
                             pitch = 11, x = 12, y = 13, heading = 14, motor_temperature = 15, payload = 17;
}

// A channel: its readings, and what robot_telemetry_t expects of them.
struct Channel {
  std::string_view name;
  std::size_t first, count;
  bool sides;         // each may be silent alone
  bool may_be_level;  // may be constant, other than 0, while the robot moves
  std::string_view contract;
};
inline constexpr auto channel_table = std::to_array<Channel>(
    {{"wheel_velocity", reading::wheel_velocity, 2, true, true,
      "rad/s at the wheel, positive forward, right before left"},
     {"motor_voltage", reading::motor_voltage, 2, true, false,
      "V at the armature, positive driving forward, right before left"},
     {"motor_current", reading::motor_current, 2, true, false,
      "A in the armature, positive driving forward, right before left"},
     {"battery_voltage", reading::battery_voltage, 1, false, false, "V"},
     {"battery_current", reading::battery_current, 1, false, false, "A, positive while discharging"},
     {"velocity_command", reading::command_speed, 2, false, true, "m/s forward and rad/s to the left"},
     {"yaw_rate", reading::yaw_rate, 1, false, false, "rad/s, positive to the left"},
     {"pitch", reading::pitch, 1, false, true, "rad, nose up positive"},
     {"pose", reading::x, 3, false, false, "m, and rad from x to y, positive to the left"},
     {"motor_temperature", reading::motor_temperature, 2, true, true, "degrees Celsius"},
     {"payload_mass", reading::payload, 1, false, true, "kg"}});

// Stands for a channel in checks of the robot file's wheel radius.
inline constexpr std::string_view radius_of_file = "wheel_radius_m";

inline std::string_view contract_of(std::string_view channel) {
  if (channel == "utime") return "us since 1970";
  if (channel == radius_of_file) return "m from the axle to the floor";
  for (const Channel& c : channel_table)
    if (channel.starts_with(c.name)) return c.contract;
  return "";
}

// Readings of a channel as named in checks: one, or a pair or group; several are separated by ", ".
inline std::vector<std::size_t> readings_of(std::string_view channels) {
  std::vector<std::size_t> found;
  while (!channels.empty()) {
    const std::string_view one = channels.substr(0, channels.find(", "));
    for (std::size_t k = 0; k < reading_count; ++k)
      if (reading_names[k] == one || reading_names[k].starts_with(std::string(one) + '.')) found.push_back(k);
    channels.remove_prefix(std::min(one.size() + 2, channels.size()));
  }
  return found;
}

}  // namespace joulecast::plausibility
