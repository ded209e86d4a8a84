#include "client/commands/parse_time.h"

#include <charconv>

#include "base/utc_time.h"

namespace joulecast::client {

Result<std::int64_t> parse_time(const std::string& text, const std::string& option) {
  const char* end = text.data() + text.size();
  std::int64_t utime_us = 0;
  if (const auto [stop, fault] = std::from_chars(text.data(), end, utime_us);
      fault == std::errc() && stop == end && utime_us >= 0)
    return utime_us;
  if (const auto parsed = parse_utc(text)) return *parsed;
  return invalid(option,
                 "'" + text + "' is neither " + std::string(utc_forms) + " nor microseconds since 1970");
}

}  // namespace joulecast::client
