#include "client/commands/parse_time.h"

#include <charconv>
#include <chrono>
#include <cstdio>

namespace joulecast::client {

Result<std::int64_t> parse_time(const std::string& text, const std::string& option) {
  const char* end = text.data() + text.size();
  std::int64_t utime_us = 0;
  if (const auto [stop, fault] = std::from_chars(text.data(), end, utime_us);
      fault == std::errc() && stop == end && utime_us >= 0)
    return utime_us;
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, used = 0;
  double second = 0;
  if (std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d:%lfZ%n", &year, &month, &day, &hour, &minute, &second,
                  &used) == 6 &&
      used == static_cast<int>(text.size())) {
    using namespace std::chrono;
    const year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                              std::chrono::day(static_cast<unsigned>(day))};
    if (date.ok() && hour >= 0 && hour < 24 && minute >= 0 && minute < 60 && second >= 0 && second < 61) {
      const auto whole = sys_days(date).time_since_epoch() + hours(hour) + minutes(minute);
      return duration_cast<microseconds>(whole).count() + static_cast<std::int64_t>(second * 1e6 + 0.5);
    }
  }
  return invalid(option, "'" + text + "' is neither UTC as 2024-07-18T09:10:45Z nor microseconds since 1970");
}

}  // namespace joulecast::client
