#pragma once

#include <nlohmann/json_fwd.hpp>

#include "client/commands/listen.h"

namespace joulecast::client {

// {"channels": [{"channel", "robot_id", "messages", "rate_hz", ..., "fields": [...], "faults": {...}}]};
// numbers that are not available are null.
[[nodiscard]] nlohmann::json to_json(const telemetry::ChannelWatch& watch);
// The same with {"dropped_datagrams": {...}}.
[[nodiscard]] nlohmann::json to_json(const Listened& listened);

}  // namespace joulecast::client
