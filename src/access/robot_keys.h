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
// As change_tokens.
Result<void> change_robot_keys(const std::string& path,
                               const std::function<Result<void>(RobotKeys&)>& change);

}  // namespace joulecast::access
