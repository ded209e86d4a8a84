#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace joulecast {

// ISO 8601 in UTC of microseconds since 1970: "2026-11-22T16:45:00Z", with the digits of the second it needs.
std::string utc_text(std::int64_t utime_us);

// By strftime's letters: "%Y-%m-%d %H:%M" gives "2026-01-31 12:00", of the second that has begun.
std::string format_utc(std::int64_t utime_us, std::string_view letters = "%Y-%m-%d %H:%M");

// "2026-11-22", "2026-11-22T16:45Z", "2026-11-22T16:45:00.25Z" or the same with an offset such as +01:00
// instead of Z; a date alone is its beginning in UTC. Empty for any other text. Further digits are cut off.
std::optional<std::int64_t> parse_utc(std::string_view text);
// The same as the end of a range: a date alone is the end of that day.
std::optional<std::int64_t> parse_utc_end(std::string_view text);

inline constexpr std::string_view utc_forms =
    "a date (2026-11-22) or a time with its zone (2026-11-22T16:45:00Z)";

}  // namespace joulecast
