#include "telemetry/stamp.h"

#include <date/tz.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <stdexcept>

#include "base/utc_time.h"

namespace joulecast::telemetry {
namespace {

using std::chrono::microseconds;
using std::chrono::minutes;
using LocalTime = date::local_time<microseconds>;

constexpr std::string_view digits = "0123456789";

// From day_first on in pairs, in which day or month is first.
constexpr std::size_t day_first = 20;
constexpr std::array<const char*, 24> stamp_forms{
    "%Y-%m-%d %H:%M:%S",     "%Y/%m/%d %H:%M:%S",    "%Y.%m.%d %H:%M:%S",    "%Y%m%d %H%M%S",
    "%Y%m%d %H:%M:%S",       "%Y/%m/%d %H:%M",       "%d.%m.%Y %H:%M:%S",    "%d.%m.%Y %H:%M",
    "%d-%b-%Y %H:%M:%S",     "%d/%b/%Y:%H:%M:%S",    "%d %b %Y %H:%M:%S",    "%a, %d %b %Y %H:%M:%S",
    "%b %d, %Y %I:%M:%S %p", "%b %d, %Y %H:%M:%S",   "%b %d %Y %H:%M:%S",    "%a %b %d %H:%M:%S %Y",
    "%Y-%m-%d %I:%M:%S %p",  "%Y/%m/%d %I:%M:%S %p", "%Y-%m-%d %H-%M-%S",    "%d.%m.%Y %I:%M:%S %p",
    "%d/%m/%Y %H:%M:%S",     "%m/%d/%Y %H:%M:%S",    "%d/%m/%Y %I:%M:%S %p", "%m/%d/%Y %I:%M:%S %p"};
constexpr std::string_view accepted_stamps =
    "; accepted are ISO 8601 (2026-03-01T08:00:00.25Z) and the like, 01.03.2026 08:00:00, 1 Mar 2026 "
    "08:00:00, "
    "or the form that \"format\" gives (%d/%m/%Y %H:%M:%S)";

bool all_digits(std::string_view text) {
  return text.find_first_not_of(digits) == std::string_view::npos;
}

// `text` has no fraction of a second.
std::optional<LocalTime> parse_stamp(const std::string& text, const std::string& form) {
  std::tm parts{};
  const char* const end = strptime(text.c_str(), form.c_str(), &parts);
  if (end == nullptr || *end != '\0') return std::nullopt;
  const int day = parts.tm_mday;
  const std::time_t since = timegm(&parts);  // of a day that the month does not have, one of the next month
  if (parts.tm_mday != day) return std::nullopt;
  return LocalTime(std::chrono::seconds(since));
}

// Takes the zone off the end: Z, UTC, GMT, +01, +0100, +01:00.
std::optional<minutes> take_offset(std::string& text) {
  for (const std::string_view name : {"Z", "UTC", "GMT"})
    if (text.ends_with(name)) {
      text.resize(text.size() - name.size());
      return minutes(0);
    }
  const std::size_t sign = text.find_last_of("+-");
  if (sign == std::string::npos || text.find_first_of(":T") >= sign) return std::nullopt;
  std::string number = text.substr(sign + 1);
  if (number.size() == 5 && number[2] == ':') number.erase(2, 1);
  if ((number.size() != 2 && number.size() != 4) || !all_digits(number)) return std::nullopt;
  const int value = std::stoi(number.size() == 2 ? number + "00" : number);
  if (value > 1400 || value % 100 > 59) return std::nullopt;
  const minutes offset(value / 100 * 60 + value % 100);
  const minutes east = text[sign] == '+' ? offset : -offset;
  text.resize(sign);
  return east;
}

// With a blank between date and time and a point before the fraction of the second.
std::string plain_stamp(std::string_view given) {
  std::string text(given);
  for (std::size_t k = 1; k + 1 < text.size(); ++k) {
    const bool between = all_digits(text.substr(k - 1, 1)) && all_digits(text.substr(k + 1, 1));
    if (text[k] == ',' && between) text[k] = '.';
    if (text[k] == 'T' && between) text[k] = ' ';
  }
  return text;
}

// Takes the fraction behind the last point off, where a time of day is before it.
microseconds take_fraction(std::string& text) {
  const std::size_t point = text.rfind('.');
  const std::size_t time = text.find_first_of(": ");
  if (point == std::string::npos || time == std::string::npos || time > point) return microseconds(0);
  const std::size_t end = std::min(text.find_first_not_of(digits, point + 1), text.size());
  std::string fraction = text.substr(point + 1, end - point - 1);
  fraction.resize(6, '0');
  text.erase(point, end - point);
  return microseconds(std::stol(fraction));
}

}  // namespace

struct StampReader::Zone {
  minutes offset{0};
  const date::time_zone* named = nullptr;

  // The two candidates of a local time; equal but in an hour that the clock repeats.
  std::array<microseconds, 2> utc(LocalTime local) const {
    const microseconds since = local.time_since_epoch();
    if (named == nullptr) return {since - offset, since - offset};
    const date::local_info info = named->get_info(local);
    const bool twice = info.result == date::local_info::ambiguous;
    return {since - info.first.offset, since - (twice ? info.second : info.first).offset};
  }
};

Result<StampReader> StampReader::create(const std::string& zone, const std::string& format) {
  StampReader reader;
  reader.format_ = format;
  if (zone.empty()) return reader;
  Zone found;
  if (const auto midnight = parse_utc("2000-01-01T00:00:00" + zone)) {
    constexpr std::int64_t midnight_utc_us = 946'684'800'000'000;
    found.offset = minutes((midnight_utc_us - *midnight) / 60'000'000);
  } else {
    try {
      found.named = date::locate_zone(zone);
    } catch (const std::runtime_error&) {
      return invalid("", "must be Z, an offset like +01:00 or a zone like Europe/Berlin");
    }
  }
  reader.zone_ = std::make_shared<const Zone>(found);
  return reader;
}

Result<std::int64_t> StampReader::read(std::string_view text) {
  const auto done = [this](std::int64_t utime_us) {
    last_utime_us_ = utime_us;
    return Result<std::int64_t>(utime_us);
  };
  const auto place = [&](LocalTime local, std::optional<minutes> offset) -> Result<std::int64_t> {
    if (offset) return done((local.time_since_epoch() - *offset).count());
    if (zone_ == nullptr) return invalid("", "is no time; time/utc_offset is for stamps that name no zone");
    const auto [first, second] = zone_->utc(local);
    const auto distance = [&](microseconds time) { return std::abs(time.count() - *last_utime_us_); };
    return done((last_utime_us_ && distance(second) < distance(first) ? second : first).count());
  };
  std::string stamp = plain_stamp(text);
  // The common form first.
  if (format_.empty() && stamp.size() > 10) {
    std::string iso = stamp;
    if (iso[10] == ' ') iso[10] = 'T';
    if (const auto time = parse_utc(iso)) return done(*time);
    if (const auto time = parse_utc(iso + 'Z')) return place(LocalTime(microseconds(*time)), std::nullopt);
  }
  const auto offset = take_offset(stamp);
  const microseconds fraction = take_fraction(stamp);
  stamp.erase(stamp.find_last_not_of(' ') + 1);
  if (!format_.empty()) {
    if (const auto local = parse_stamp(stamp, format_)) return place(*local + fraction, offset);
    return invalid("", "is no time of the form " + format_);
  }
  for (std::size_t k = 0; k < stamp_forms.size(); ++k) {
    const std::size_t form = (form_ + k) % stamp_forms.size();
    const auto local = parse_stamp(stamp, stamp_forms[form]);
    if (!local) continue;
    const auto other = form < day_first ? std::nullopt : parse_stamp(stamp, stamp_forms[form ^ 1]);
    if (other && *other != *local)
      return invalid("", "is no time: day or month may be first; \"format\" decides (%d/%m/%Y %H:%M:%S)");
    form_ = form;
    return place(*local + fraction, offset);
  }
  return invalid("", std::string("is no time").append(accepted_stamps));
}

}  // namespace joulecast::telemetry
