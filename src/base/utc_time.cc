#include "base/utc_time.h"

#include <fmt/chrono.h>

#include <boost/xpressive/xpressive_dynamic.hpp>
#include <chrono>

namespace joulecast {

using namespace std::chrono;

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
  static const auto form = boost::xpressive::cregex::compile(
      R"((\d{4})-(\d\d)-(\d\d)(?:T(\d\d):(\d\d)(?::(\d\d)(?:\.(\d+))?)?(?:Z|([-+])(\d\d):(\d\d)))?)");
  boost::xpressive::cmatch part;
  if (!regex_match(text.data(), text.data() + text.size(), part, form)) return std::nullopt;
  const auto number = [&](std::size_t i) { return part[i].matched ? std::stoi(part[i]) : 0; };
  const year_month_day date{year(number(1)), month(number(2)), day(number(3))};
  if (!date.ok() || number(4) > 23 || number(5) > 59 || number(6) > 60 || number(9) > 23 || number(10) > 59)
    return std::nullopt;
  std::string decimals = part[7];
  decimals.resize(6, '0');
  const minutes offset = hours(number(9)) + minutes(number(10));
  const seconds local =
      sys_days(date).time_since_epoch() + hours(number(4)) + minutes(number(5)) + seconds(number(6));
  return (local + microseconds(std::stoi(decimals)) - (part[8] == "-" ? -offset : offset)).count();
}

std::optional<std::int64_t> parse_utc_end(std::string_view text) {
  const bool has_time = text.find('T') != std::string_view::npos;
  const auto parsed = parse_utc(text);
  return parsed && !has_time ? *parsed + microseconds(days(1)).count() : parsed;
}

}  // namespace joulecast
