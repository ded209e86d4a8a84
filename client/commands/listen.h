#pragma once

#include <cstdlib>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/error.h"
#include "telemetry/channel_watch.h"
#include "telemetry/datagram.h"
#include "telemetry/lcm_link.h"
#include "telemetry/recording.h"

namespace joulecast::client {

// Where commands publish by default: JOULECAST_LCM_URL, which the daemon reads too, or the daemon's default.
inline std::string usual_lcm_url() {
  const char* url = std::getenv("JOULECAST_LCM_URL");
  return url != nullptr && *url != '\0' ? std::string(url) : std::string(telemetry::default_lcm_url);
}

struct ListenOptions {
  std::string lcm_url;
  std::string robot_id;  // empty: all
  double seconds = 10;   // 0: until interrupted
};

struct Listened {
  telemetry::ChannelWatch watch;
  telemetry::DatagramCounters datagrams;
};

// Listens to robots over LCM until the time is over or ctrl-C. `tick` is called about once a second, `take`
// with every telemetry sample that decodes. Errors are those of opening and receiving.
[[nodiscard]] Result<void> listen(
    const ListenOptions& options, Listened& listened, const std::function<void(const Listened&)>& tick = {},
    const std::function<void(const std::string& robot_id, const signals::Sample&)>& take = {});

// "3 malformed, 1 foreign_sender"; datagrams of other programs of the group are left out.
[[nodiscard]] std::string dropped_datagrams(const Listened& listened);
// Report when no robot was received: the address, messages on other channels, and suggestions.
[[nodiscard]] std::string why_silent(const std::string& lcm_url, const Listened& listened);

// {"channels": [{"channel", "robot_id", "messages", "rate_hz", ..., "fields": [...], "faults": {...}}]};
// numbers that are not available are null.
[[nodiscard]] nlohmann::json to_json(const telemetry::ChannelWatch& watch);
// The same with {"dropped_datagrams": {...}}.
[[nodiscard]] nlohmann::json to_json(const Listened& listened);

}  // namespace joulecast::client
