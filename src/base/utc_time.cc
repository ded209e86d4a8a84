#include "base/utc_time.h"

#include <charconv>
#include <chrono>
#include <cstdio>

namespace joulecast {
namespace {

using namespace std::chrono;

// Takes digits off the front; nothing unless there are just so many.
std::optional<int> take_digits(std::string_view& text, std::size_t count) {
  int value = 0;
  if (text.size() < count) return std::nullopt;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + count, value);
  if (fault != std::errc() || end != text.data() + count || value < 0 || text[0] == '-') return std::nullopt;
  text.remove_prefix(count);
  return value;
}

bool take(std::string_view& text, char c) {
  if (!text.starts_with(c)) return false;
  text.remove_prefix(1);
  return true;
}

// "16:45"
std::optional<minutes> take_clock(std::string_view& text) {
  const auto hour = take_digits(text, 2);
  if (!hour || *hour > 23 || !take(text, ':')) return std::nullopt;
  const auto minute = take_digits(text, 2);
  if (!minute || *minute > 59) return std::nullopt;
  return hours(*hour) + minutes(*minute);
}

// ":00.25", or nothing at all.
std::optional<microseconds> take_second(std::string_view& text) {
  if (!take(text, ':')) return microseconds(0);
  const auto second = take_digits(text, 2);
  if (!second || *second > 60) return std::nullopt;
  microseconds sum = seconds(*second);
  if (!take(text, '.')) return sum;
  std::int64_t unit = 1'000'000;
  bool any = false;
  for (; !text.empty() && text[0] >= '0' && text[0] <= '9'; text.remove_prefix(1), any = true) {
    unit /= 10;
    sum += microseconds(unit * (text[0] - '0'));
  }
  return any ? std::optional(sum) : std::nullopt;
}

std::optional<minutes> take_zone(std::string_view& text) {
  if (take(text, 'Z')) return minutes(0);
  const bool east = text.starts_with('+');
  if (!take(text, '+') && !take(text, '-')) return std::nullopt;
  const auto offset = take_clock(text);
  return offset ? std::optional(east ? *offset : -*offset) : std::nullopt;
}

}  // namespace

std::string utc_text(std::int64_t utime_us) {
  const sys_time<microseconds> at{microseconds(utime_us)};
  const auto day = floor<days>(at);
  const year_month_day date(day);
  const hh_mm_ss clock(at - day);
  char text[48];
  int length =
      std::snprintf(text, sizeof text, "%04d-%02u-%02uT%02d:%02d:%02d.%06d", static_cast<int>(date.year()),
                    static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                    static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
                    static_cast<int>(clock.seconds().count()), static_cast<int>(clock.subseconds().count()));
  while (text[length - 1] == '0') --length;
  if (text[length - 1] == '.') --length;
  return std::string(text, static_cast<std::size_t>(length)) + 'Z';
}

std::optional<std::int64_t> parse_utc(std::string_view text) {
  const auto y = take_digits(text, 4);
  if (!y || !take(text, '-')) return std::nullopt;
  const auto m = take_digits(text, 2);
  if (!m || !take(text, '-')) return std::nullopt;
  const auto d = take_digits(text, 2);
  if (!d) return std::nullopt;
  const year_month_day date{year(*y), month(static_cast<unsigned>(*m)), day(static_cast<unsigned>(*d))};
  if (!date.ok()) return std::nullopt;
  const microseconds midnight = sys_days(date).time_since_epoch();
  if (text.empty()) return midnight.count();
  if (!take(text, 'T')) return std::nullopt;
  const auto clock = take_clock(text);
  const auto second = clock ? take_second(text) : std::nullopt;
  const auto zone = second ? take_zone(text) : std::nullopt;
  if (!zone || !text.empty()) return std::nullopt;
  return (midnight + *clock + *second - *zone).count();
}

}  // namespace joulecast
