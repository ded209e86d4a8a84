#pragma once

#include <chrono>
#include <cstdint>

namespace joulecast {

// The host's clock, microseconds since the Unix epoch. Robots have clocks of their own.
inline std::int64_t host_utime_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace joulecast
