#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

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

// True if a reading belongs to a channel as named in checks: the same, or a side or part of it. `channels`
// may be several, separated by ", ".
inline bool belongs_to(std::string_view reading, std::string_view channels) {
  while (!channels.empty()) {
    const std::size_t end = channels.find(", ");
    const std::string_view channel = channels.substr(0, end);
    if (reading.starts_with(channel) &&
        (reading.size() == channel.size() || reading[channel.size()] == '.')) {
      return true;
    }
    if (end == std::string_view::npos) break;
    channels.remove_prefix(end + 2);
  }
  return false;
}

}  // namespace joulecast::plausibility
