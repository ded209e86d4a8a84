#include "telemetry/stamp.h"

#include <date/tz.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <ctime>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/utc_time.h"

namespace joulecast::telemetry {
namespace {

using std::chrono::microseconds;
using std::chrono::minutes;
using LocalTime = date::local_time<microseconds>;

constexpr std::string_view digits = "0123456789";
constexpr std::string_view accepted_stamps =
    "; accepted are ISO 8601 (2026-03-01T08:00:00.25Z) and the like, 01.03.2026 08:00:00, 1 Mar 2026 "
    "08:00:00, a time of day (08:00:00), or the form that \"format\" gives (%d/%m/%Y %H:%M:%S)";
constexpr std::string_view doubtful =
    "is no time: day, month or year may be first; \"format\" decides (%d/%m/%Y %H:%M:%S)";

bool all_digits(std::string_view text) {
  return text.find_first_not_of(digits) == std::string_view::npos;
}

// `text` has no fraction of a second.
std::optional<LocalTime> parse_stamp(const std::string& text, const std::string& form) {
  std::tm parts{};
  parts.tm_year = 70;  // of a form without a date
  parts.tm_mday = 1;
  const char* const end = strptime(text.c_str(), form.c_str(), &parts);
  if (end == nullptr || *end != '\0') return std::nullopt;
  const int day = parts.tm_mday;
  const std::time_t since = timegm(&parts);  // of a day that the month does not have, one of the next month
  if (parts.tm_mday != day) return std::nullopt;
  return LocalTime(std::chrono::seconds(since));
}

// Takes the zone off the end: Z, UTC, GMT, +01, +0100, +01:00, +0000 UTC.
std::optional<minutes> take_offset(std::string& text) {
  for (const std::string_view name : {"Z", "z", "UTC", "GMT"})
    if (text.ends_with(name) && text.size() > name.size()) {
      text.resize(text.find_last_not_of(' ', text.size() - name.size() - 1) + 1);
      return take_offset(text).value_or(minutes(0));
    }
  const std::size_t sign = text.find_last_of("+-");
  if (sign == std::string::npos || text.find_first_of(":T") > sign) return std::nullopt;
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

microseconds fraction_of(std::string_view part) {
  std::string number(part);
  number.resize(6, '0');
  return microseconds(std::stol(number));
}

// Takes the fraction behind the last point off, where a time of day is before it.
microseconds take_fraction(std::string& text) {
  const std::size_t point = text.rfind('.');
  const std::size_t time = text.find_first_of(": ");
  if (point == std::string::npos || time == std::string::npos || time > point) return microseconds(0);
  const std::size_t end = std::min(text.find_first_not_of(digits, point + 1), text.size());
  const microseconds fraction = fraction_of(std::string_view(text).substr(point + 1, end - point - 1));
  text.erase(point, end - point);
  return fraction;
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// Takes digits off the front; empty where there are none or more than `most`.
std::optional<int> take_number(std::string_view& text, std::size_t most) {
  const std::size_t end = std::min(text.find_first_not_of(digits), text.size());
  if (end == 0 || end > most) return std::nullopt;
  const int value = std::stoi(std::string(text.substr(0, end)));
  text.remove_prefix(end);
  return value;
}

// Takes a time of day out of a stamp: 8:00, 08:00:00.25, 8:00:00 PM; minutes and a fraction of a second,
// 00:59.5. After a blank, points or dashes may divide it. Empty where there is none.
std::optional<microseconds> take_time_of_day(std::string& stamp, char divider) {
  for (std::size_t at = 0; at < stamp.size(); ++at) {
    if (!is_digit(stamp[at]) || (at > 0 && (divider == ':' ? is_digit(stamp[at - 1]) : stamp[at - 1] != ' ')))
      continue;
    std::string_view rest = std::string_view(stamp).substr(at);
    std::array<int, 3> parts{};
    std::size_t count = 0;
    for (; count < parts.size(); ++count) {
      if (count > 0 && (!rest.starts_with(divider) || rest.size() < 2 || !is_digit(rest[1]))) break;
      if (count > 0) rest.remove_prefix(1);
      const auto number = take_number(rest, 2);
      if (!number) break;
      parts[count] = *number;
    }
    if (count < 2 || (count == 2 && divider != ':')) continue;
    microseconds fraction(0);
    if (rest.size() > 1 && std::string_view(".,:").find(rest[0]) != std::string_view::npos &&
        is_digit(rest[1])) {
      const std::size_t end = std::min(rest.find_first_not_of(digits, 1), rest.size());
      fraction = fraction_of(rest.substr(1, end - 1));
      rest.remove_prefix(end);
      if (count == 2) parts = {0, parts[0], parts[1]};
    }
    const std::size_t word = std::min(rest.find_first_not_of(' '), rest.size());
    const char half = word < rest.size() ? static_cast<char>(std::tolower(rest[word])) : ' ';
    const bool twelve = (half == 'a' || half == 'p') && word + 1 < rest.size() &&
                        std::string_view("mM.").find(rest[word + 1]) != std::string_view::npos;
    if (twelve) {
      if (parts[0] < 1 || parts[0] > 12) return std::nullopt;
      parts[0] = parts[0] % 12 + (half == 'p' ? 12 : 0);
      rest.remove_prefix(std::min(rest.find_first_of(' ', word), rest.size()));
    }
    if (parts[0] > 24 || parts[1] > 59 || parts[2] > 60) return std::nullopt;
    stamp = stamp.substr(0, at).append(" ").append(rest);
    return std::chrono::hours(parts[0]) + minutes(parts[1]) + std::chrono::seconds(parts[2]) + fraction;
  }
  return std::nullopt;
}

// 0: neither the name of a month nor a day's; a month's number; 13: a day's name.
unsigned calendar_word(std::string word) {
  constexpr std::string_view months = "janfebmaraprmayjunjulaugsepoctnovdec", days = "montuewedthufrisatsun";
  if (word.size() < 3) return 0;
  word.resize(3);
  std::ranges::transform(word, word.begin(), [](unsigned char c) { return std::tolower(c); });
  const std::size_t month = months.find(word), day = days.find(word);
  if (month != std::string_view::npos && month % 3 == 0) return static_cast<unsigned>(month / 3) + 1;
  return day != std::string_view::npos && day % 3 == 0 ? 13 : 0;
}

// A date of three numbers, or of two with the name of a month and perhaps a day's; nothing of any other text.
// `doubt`: it may be of different days.
std::optional<date::sys_days> date_of(std::string_view text, bool& doubt) {
  std::vector<std::pair<int, std::size_t>> numbers;  // with their digits
  unsigned named = 0;
  const bool points = text.find('.') != std::string_view::npos;
  while (!text.empty()) {
    const std::size_t size = std::min(text.find_first_not_of(digits), text.size());
    std::size_t letters = 0;
    while (letters < text.size() && std::isalpha(static_cast<unsigned char>(text[letters])) != 0) ++letters;
    if (size == 8) {
      for (const std::size_t part : {4u, 2u, 2u}) {
        numbers.emplace_back(std::stoi(std::string(text.substr(0, part))), part);
        text.remove_prefix(part);
      }
    } else if (size > 0) {
      const auto number = take_number(text, 4);
      if (!number) return std::nullopt;
      numbers.emplace_back(*number, size);
    } else if (letters > 0) {
      const std::string word(text.substr(0, letters));
      const unsigned known = calendar_word(word);
      if (known == 0 && word != "T" && word != "t") return std::nullopt;
      if (known > 0 && known < 13) named = known;
      text.remove_prefix(letters);
    } else {
      text.remove_prefix(1);
    }
  }
  std::optional<date::sys_days> found;
  const auto reading = [&](std::size_t year, std::size_t month, std::size_t day) {
    const auto of = [&](std::size_t k) { return static_cast<unsigned>(numbers[k].first); };
    if (numbers[year].second != 4 && numbers[year].second != 2) return;
    const date::year_month_day whole{date::year(numbers[year].first + (numbers[year].second == 2 ? 2000 : 0)),
                                     date::month(named > 0 ? named : of(month)), date::day(of(day))};
    if (!whole.ok()) return;
    doubt = doubt || (found && *found != date::sys_days(whole));
    if (!found) found = date::sys_days(whole);
  };
  if (numbers.size() != (named > 0 ? 2u : 3u)) return std::nullopt;
  if (numbers[0].second == 4) {
    reading(0, 1, numbers.size() - 1);
  } else if (named > 0) {
    reading(1, 0, 0);
  } else {
    reading(2, 1, 0);
    if (points) return found;
    reading(2, 0, 1);
    if (numbers[2].second == 2) reading(0, 1, 2);
  }
  return found;
}

// The time behind a date in digits alone, or divided by anything: 20251126T080000.25, 2025-11-26-08-00-00.
std::optional<microseconds> take_compact_time(std::string& stamp) {
  constexpr std::size_t date_digits = 8, all_but_fraction = 14;
  std::string number;
  for (const char c : stamp) {
    if (is_digit(c))
      number += c;
    else if (std::isalpha(static_cast<unsigned char>(c)) != 0 && c != 'T')
      return std::nullopt;
  }
  if (number.size() < all_but_fraction || stamp.find_first_not_of(digits) < 4) return std::nullopt;
  const int time = std::stoi(number.substr(date_digits, 6));
  if (time / 10'000 > 24 || time / 100 % 100 > 59 || time % 100 > 60) return std::nullopt;
  stamp = number.substr(0, date_digits);
  return std::chrono::hours(time / 10'000) + minutes(time / 100 % 100) + std::chrono::seconds(time % 100) +
         fraction_of(std::string_view(number).substr(all_but_fraction));
}

// Takes a zone's name or abbreviation out: CET, Europe/Berlin.
std::string take_zone_name(std::string& stamp) {
  for (std::size_t at = 0; at < stamp.size();) {
    const std::size_t end = std::min(stamp.find(' ', at), stamp.size());
    const std::string word = stamp.substr(at, end - at);
    const bool slash = word.find('/') != std::string::npos && word.find_first_of(digits) == std::string::npos;
    const bool capitals =
        word.size() > 2 && word.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ") == std::string::npos;
    if ((slash || capitals) && calendar_word(word) == 0) {
      stamp.erase(at, end - at);
      return word;
    }
    at = end + 1;
  }
  return {};
}

}  // namespace

struct StampReader::Zone {
  minutes offset{0};
  const date::time_zone* named = nullptr;

  // The two candidates of a local time; equal but in an hour that the clock repeats, and its abbreviations.
  struct Candidate {
    microseconds utc{};
    std::string name{};
  };
  std::array<Candidate, 2> utc(LocalTime local) const {
    const microseconds since = local.time_since_epoch();
    if (named == nullptr) return {Candidate{since - offset}, Candidate{since - offset}};
    const date::local_info info = named->get_info(local);
    const auto& second = info.result == date::local_info::ambiguous ? info.second : info.first;
    return {Candidate{since - info.first.offset, info.first.abbrev},
            Candidate{since - second.offset, second.abbrev}};
  }
};

Result<StampReader> StampReader::create(const std::string& zone, const std::string& format) {
  StampReader reader;
  reader.format_ = format;
  if (zone.empty()) return reader;
  Zone found;
  std::string at_midnight = "00:00:00" + zone;
  if (const auto offset = take_offset(at_midnight)) {
    found.offset = *offset;
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
  const auto place = [&](LocalTime local, std::optional<minutes> offset,
                         const std::string& name = {}) -> Result<std::int64_t> {
    if (local.time_since_epoch() < date::days(1)) return done(of_next_day(local.time_since_epoch().count()));
    if (offset) return done((local.time_since_epoch() - *offset).count());
    std::shared_ptr<const Zone> zone = zone_;
    const auto candidates_of = [&] { return zone ? zone->utc(local) : std::array<Zone::Candidate, 2>{}; };
    auto candidates = candidates_of();
    if (!name.empty()) {
      for (const auto& candidate : candidates)
        if (candidate.name == name) return done(candidate.utc.count());
      const auto own = create(name);
      if (!own)
        return invalid("", "is no time: the zone " + name +
                               " is not known; \"utc_offset\" gives it by a name like Europe/Berlin");
      zone = own->zone_;
      candidates = candidates_of();
    }
    if (zone == nullptr) return invalid("", "is no time; time/utc_offset is for stamps that name no zone");
    const auto& [first, second] = candidates;
    const auto distance = [&](microseconds time) { return std::abs(time.count() - *last_utime_us_); };
    return done((last_utime_us_ && distance(second.utc) < distance(first.utc) ? second : first).utc.count());
  };
  std::string stamp(text);
  // The common form first.
  if (format_.empty() && stamp.size() > 10) {
    std::string iso = stamp;
    if (iso[10] == ' ') iso[10] = 'T';
    if (const auto time = parse_utc(iso)) return done(*time);
    if (const auto time = parse_utc(iso + 'Z')) return place(LocalTime(microseconds(*time)), std::nullopt);
  }
  if (const std::size_t name = stamp.find('['); name != std::string::npos && stamp.ends_with(']'))
    stamp.resize(name);  // of a zone, after its offset
  const auto offset = take_offset(stamp);
  if (!format_.empty()) {
    const microseconds fraction = take_fraction(stamp);
    stamp.erase(stamp.find_last_not_of(' ') + 1);
    if (const auto local = parse_stamp(stamp, format_)) return place(*local + fraction, offset);
    return invalid("", "is no time of the form " + format_);
  }
  const std::string name = take_zone_name(stamp);
  auto time_of_day = take_time_of_day(stamp, ':');
  for (const char divider : {'.', '-'})
    if (!time_of_day) time_of_day = take_time_of_day(stamp, divider);
  if (!time_of_day) time_of_day = take_compact_time(stamp);
  if (time_of_day && stamp.find_first_not_of(" T") == std::string::npos)
    return place(LocalTime(*time_of_day), offset);
  bool doubt = false;
  const auto day = time_of_day ? date_of(stamp, doubt) : std::nullopt;
  if (doubt) return invalid("", std::string(doubtful));
  if (!day) return invalid("", std::string("is no time").append(accepted_stamps));
  return place(LocalTime(day->time_since_epoch() + *time_of_day), offset, name);
}

// A time of day without a date, on the day that follows where it goes back by more than half of one.
std::int64_t StampReader::of_next_day(std::int64_t since_midnight_us) const {
  constexpr std::int64_t day_us = 86'400'000'000;
  const std::int64_t days = last_utime_us_ ? (*last_utime_us_ - since_midnight_us + day_us / 2) / day_us : 0;
  return since_midnight_us + std::max<std::int64_t>(days, 0) * day_us;
}

}  // namespace joulecast::telemetry
