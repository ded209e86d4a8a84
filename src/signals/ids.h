#pragma once

#include <cstddef>
#include <string_view>

// Names that travel in LCM messages and channels, in URLs and in file names.
namespace joulecast::signals {

// LCM rejects channels over 63 characters, of which "ROBOT_TELEMETRY." takes 16.
inline constexpr std::size_t max_robot_id_length = 47;
inline constexpr std::size_t max_mission_id_length = 128;
inline constexpr std::size_t max_note_length = 1024;

// Letters, digits, '.', '_' and '-', one character at least.
[[nodiscard]] bool is_valid_robot_id(std::string_view id) noexcept;
[[nodiscard]] bool is_valid_mission_id(std::string_view id) noexcept;

}  // namespace joulecast::signals
