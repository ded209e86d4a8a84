#include "telemetry/stamp.h"

#include <date/tz.h>
#include <re2/re2.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <ctime>
#include <stdexcept>
#include <vector>

#include "base/utc_time.h"

namespace joulecast::telemetry {
namespace {

using std::chrono::microseconds;
using std::chrono::minutes;
using LocalTime = date::local_time<microseconds>;

constexpr std::string_view accepted_stamps =
    "; accepted are ISO 8601 (2026-03-01T08:00:00.25Z) and the like, 01.03.2026 08:00:00, 1 Mar 2026 "
    "08:00:00, a time of day (08:00:00), or the form that \"format\" gives (%d/%m/%Y %H:%M:%S)";
constexpr std::string_view doubtful =
    "is no time: day, month or year may be first; \"format\" decides (%d/%m/%Y %H:%M:%S)";

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
  static const RE2 name("(.+?)(?: *(?:Z|z|UTC|GMT))+"), number(R"((.*[:T].*)([-+])(\d\d)(?::?(\d\d))?)");
  std::string before, sign, hour, minute;
  const bool named = RE2::FullMatch(text, name, &before);
  if (named) text = before;
  const bool numbered = RE2::FullMatch(text, number, &before, &sign, &hour, &minute);
  const int value = numbered ? std::stoi(hour + (minute.empty() ? "00" : minute)) : 0;
  if (!numbered || value > 1400 || value % 100 > 59) return named ? std::optional(minutes(0)) : std::nullopt;
  text = before;
  const minutes offset(value / 100 * 60 + value % 100);
  return sign == "+" ? offset : -offset;
}

microseconds fraction_of(std::string number) {
  number.resize(6, '0');
  return microseconds(std::stol(number));
}

// Takes the fraction behind the last point off, where a time of day is before it.
microseconds take_fraction(std::string& text) {
  static const RE2 form(R"((.*[: ].*)\.(\d*)([^.]*))");
  std::string before, number, behind;
  if (!RE2::FullMatch(text, form, &before, &number, &behind)) return microseconds(0);
  text = before + behind;
  return fraction_of(number);
}

std::optional<microseconds> time_of(int hour, int minute, int second, const std::string& fraction) {
  if (hour > 24 || minute > 59 || second > 60) return std::nullopt;
  return std::chrono::hours(hour) + minutes(minute) + std::chrono::seconds(second) + fraction_of(fraction);
}

// Takes a time of day out of a stamp: 8:00, 08:00:00.25, 8:00:00 PM; minutes and a fraction of a second,
// 00:59.5; after a blank also 08.00.00 and 08-00-00. Empty where there is none.
std::optional<microseconds> take_time_of_day(std::string& stamp) {
  static const std::string behind = R"((?: *([aApP])[mM.][^ ]*)?((?:\D.*)?))";
  static const RE2 forms[] = {{R"((|.*?\D)(\d\d?):(\d\d?)(?::(\d\d?)(?:[.,:](\d+))?|[.,](\d+))?)" + behind},
                              {R"((|.*? )(\d\d?)\.(\d\d?)\.(\d\d?)(?:[.,:](\d+))?())" + behind},
                              {R"((|.*? )(\d\d?)-(\d\d?)-(\d\d?)(?:[.,:](\d+))?())" + behind}};
  for (const RE2& form : forms) {
    std::string before, first, second, third, fraction, of_minutes, half, rest;
    if (!RE2::FullMatch(stamp, form, &before, &first, &second, &third, &fraction, &of_minutes, &half, &rest))
      continue;
    std::array<int, 3> parts{std::stoi(first), std::stoi(second), third.empty() ? 0 : std::stoi(third)};
    if (!of_minutes.empty()) parts = {0, parts[0], parts[1]};
    if (!half.empty() && (parts[0] < 1 || parts[0] > 12)) continue;
    if (!half.empty()) parts[0] = parts[0] % 12 + (half == "p" || half == "P" ? 12 : 0);
    const auto time = time_of(parts[0], parts[1], parts[2], fraction + of_minutes);
    if (!time) continue;
    stamp = before + " " + rest;
    return time;
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
std::optional<date::sys_days> date_of(const std::string& text, bool& doubt) {
  static const RE2 token(R"((\d+)|([A-Za-z]+))");
  std::vector<std::string> numbers;
  unsigned named = 0;
  const bool points = text.find('.') != std::string::npos;
  std::string number, word;
  for (re2::StringPiece rest(text); RE2::FindAndConsume(&rest, token, &number, &word);) {
    const unsigned known = calendar_word(word);
    if (known > 0 && known < 13) named = known;
    if (number.size() == 8)
      numbers.insert(numbers.end(), {number.substr(0, 4), number.substr(4, 2), number.substr(6)});
    else if (number.size() > 4 || (number.empty() && known == 0 && word != "T" && word != "t"))
      return std::nullopt;
    else if (!number.empty())
      numbers.push_back(number);
  }
  std::optional<date::sys_days> found;
  const auto reading = [&](std::size_t year, std::size_t month, std::size_t day) {
    const auto of = [&](std::size_t k) { return static_cast<unsigned>(std::stoi(numbers[k])); };
    const std::size_t digits_of_year = numbers[year].size();
    if (digits_of_year != 4 && digits_of_year != 2) return;
    const date::year_month_day whole{date::year(std::stoi(numbers[year]) + (digits_of_year == 2 ? 2000 : 0)),
                                     date::month(named > 0 ? named : of(month)), date::day(of(day))};
    if (!whole.ok()) return;
    doubt = doubt || (found && *found != date::sys_days(whole));
    if (!found) found = date::sys_days(whole);
  };
  if (numbers.size() != (named > 0 ? 2u : 3u)) return std::nullopt;
  if (numbers[0].size() == 4) {
    reading(0, 1, numbers.size() - 1);
  } else if (named > 0) {
    reading(1, 0, 0);
  } else {
    reading(2, 1, 0);
    if (points) return found;
    reading(2, 0, 1);
    if (numbers[2].size() == 2) reading(0, 1, 2);
  }
  return found;
}

// The time behind a date in digits alone, or divided by anything: 20251126T080000.25, 2025-11-26-08-00-00.
std::optional<microseconds> take_compact_time(std::string& stamp) {
  static const RE2 form(R"(\d{4}(?:[^A-Za-z]|T)*)"), numbers(R"((\d{8})(\d\d)(\d\d)(\d\d)(\d*))");
  std::string number = stamp, day, fraction;
  int hour = 0, minute = 0, second = 0;
  RE2::GlobalReplace(&number, R"(\D)", "");
  if (!RE2::FullMatch(stamp, form) ||
      !RE2::FullMatch(number, numbers, &day, &hour, &minute, &second, &fraction))
    return std::nullopt;
  const auto time = time_of(hour, minute, second, fraction);
  if (time) stamp = day;
  return time;
}

// Takes a zone's name or abbreviation out: CET, Europe/Berlin.
std::string take_zone_name(std::string& stamp) {
  static const RE2 token("([^ ]+)"), zone(R"(\D*/\D*|[A-Z]{3,})");
  std::string word;
  for (re2::StringPiece rest(stamp); RE2::FindAndConsume(&rest, token, &word);)
    if (RE2::FullMatch(word, zone) && calendar_word(word) == 0) {
      stamp.erase(stamp.size() - rest.size() - word.size(), word.size());
      return word;
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
    if (zone == nullptr)
      return invalid(
          "", "names no time zone: set \"utc_offset\" of \"time\", such as \"Z\" or \"Europe/Berlin\"");
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
  auto time_of_day = take_time_of_day(stamp);
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
