#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "telemetry/sample.h"

namespace joulecast::gap {

// The readings of a sample one by one, in the order of robot_telemetry_t, by the names that checks use.
inline constexpr auto reading_names = std::to_array<std::string_view>(
    {"wheel_velocity.right", "wheel_velocity.left", "motor_voltage.right", "motor_voltage.left",
     "motor_current.right", "motor_current.left", "battery_voltage", "battery_current",
     "velocity_command.speed", "velocity_command.turn", "yaw_rate", "pitch", "pose.x", "pose.y",
     "pose.heading", "motor_temperature.right", "motor_temperature.left", "payload_mass"});
inline constexpr std::size_t reading_count = reading_names.size();

// Their places in that order; of the pairs the right one.
namespace reading {
inline constexpr std::size_t wheel_velocity = 0, motor_voltage = 2, motor_current = 4, battery_voltage = 6,
                             battery_current = 7, command_speed = 8, command_turn = 9, yaw_rate = 10,
                             pitch = 11, x = 12, y = 13, heading = 14, motor_temperature = 15, payload = 17;
}

// Pointers to the readings of a sample (const or not).
template <class S>
auto readings_of(S& s) {
  return std::array{&s.wheel_velocity_rad_s[0],
                    &s.wheel_velocity_rad_s[1],
                    &s.motor_voltage_v[0],
                    &s.motor_voltage_v[1],
                    &s.motor_current_a[0],
                    &s.motor_current_a[1],
                    &s.battery_voltage_v,
                    &s.battery_current_a,
                    &s.velocity_command[0],
                    &s.velocity_command[1],
                    &s.yaw_rate_rad_s,
                    &s.pitch_rad,
                    &s.pose[0],
                    &s.pose[1],
                    &s.pose[2],
                    &s.motor_temperature_c[0],
                    &s.motor_temperature_c[1],
                    &s.payload_kg};
}

// Whether a reading belongs to a channel as checks name it: the same, or a side or part of it. `channels` may
// be several, separated by ", ".
bool belongs_to(std::string_view reading, std::string_view channels);

}  // namespace joulecast::gap
