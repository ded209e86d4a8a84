#include "client/commands/parse_time.h"

#include <charconv>

#include "base/utc_time.h"

namespace joulecast::client {

namespace {

constexpr std::size_t date_length = 10;  // of 2024-07-18

Value time_by(Result<std::int64_t> (*parse)(const std::string& text, const std::string& option)) {
  return {.name = "TIME",
          .check = {[parse](std::string& text) -> std::string {
                      const auto utime_us = parse(text, {});
                      if (!utime_us) return utime_us.error().message;
                      text = std::to_string(*utime_us);
                      return {};
                    },
                    ""}};
}

}  // namespace

Result<std::int64_t> parse_time(const std::string& text, const std::string& option) {
  const char* end = text.data() + text.size();
  std::int64_t utime_us = 0;
  if (const auto [stop, fault] = std::from_chars(text.data(), end, utime_us);
      fault == std::errc() && stop == end && utime_us >= 0)
    return utime_us;
  if (const auto parsed = parse_utc(text)) return *parsed;
  const bool dated = text.size() >= date_length && text[4] == '-' && text[7] == '-';
  if (dated && !parse_utc(text.substr(0, date_length)))
    return invalid(option, "there is no day " + text.substr(0, date_length));
  return invalid(option,
                 "'" + text + "' is neither " + std::string(utc_forms) + " nor microseconds since 1970");
}

Result<std::int64_t> parse_end_time(const std::string& text, const std::string& option) {
  constexpr std::int64_t day_us = 86'400'000'000;
  const bool day_alone = text.size() == date_length && parse_utc(text);
  return parse_time(text, option).map([&](std::int64_t utime_us) {
    return day_alone ? utime_us + day_us : utime_us;
  });
}

Value time_value() {
  return time_by(parse_time);
}

Value end_time_value() {
  return time_by(parse_end_time);
}

}  // namespace joulecast::client
