#pragma once

#include <cstdlib>
#include <string>

#include "telemetry/lcm_link.h"

namespace joulecast::client {

// Where commands publish by default: JOULECAST_LCM_URL, which the daemon reads too, or the daemon's default.
inline std::string usual_lcm_url() {
  const char* url = std::getenv("JOULECAST_LCM_URL");
  return url != nullptr && *url != '\0' ? std::string(url) : std::string(telemetry::default_lcm_url);
}

}  // namespace joulecast::client
