#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "base/error.h"

namespace joulecast::access {

inline constexpr std::size_t robot_key_bytes = 32;

// The key by which a robot signs its messages, by robot_id; 32 bytes each.
using RobotKeys = std::map<std::string, std::string, std::less<>>;

// {"keys": [{"robot_id": "amr-07", "key": "<64 hexadecimal digits>"}]}
Result<RobotKeys> parse_robot_keys(std::string_view json_text);
std::string to_json_text(const RobotKeys& keys);

// Fault::invalid also where users other than the file's owner and group may read it.
Result<RobotKeys> read_robot_keys(const std::string& path);
// In one step; a new file is the owner's and the group's alone.
Result<void> write_robot_keys(const std::string& path, const RobotKeys& keys);

}  // namespace joulecast::access
