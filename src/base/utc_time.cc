#include "base/utc_time.h"

#include <fmt/chrono.h>

#include <charconv>
#include <chrono>

namespace joulecast {
namespace {

using namespace std::chrono;

// Takes digits off the front; empty unless there are exactly so many.
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

// ":00.25", or an empty text.
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
  const microseconds at(utime_us);
  std::string text =
      format_utc(utime_us, "%Y-%m-%dT%H:%M:%S") + fmt::format(".{:06}", (at - floor<seconds>(at)).count());
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text + 'Z';
}

std::string format_utc(std::int64_t utime_us, std::string_view letters) {
  const auto whole = floor<seconds>(microseconds(utime_us));
  const std::string form = std::string("{:").append(letters).append("}");
  return fmt::format(fmt::runtime(form), fmt::gmtime(static_cast<std::time_t>(whole.count())));
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
