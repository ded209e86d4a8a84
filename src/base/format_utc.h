#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace joulecast {

// Microseconds since the Unix epoch in UTC, by strftime's letters: "%Y-%m-%d %H:%M" gives "2026-01-31 12:00".
std::string format_utc(std::int64_t utime_us, std::string_view letters = "%Y-%m-%d %H:%M");

}  // namespace joulecast
