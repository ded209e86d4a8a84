#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "plausibility/evaluation.h"

namespace joulecast::plausibility {
namespace {

constexpr double year_us = 365.25 * 86400e6;
constexpr double earliest_year = 1990, latest_year = 2100;
// Robots record at most 1000 rows a second, and recordings without a date at least one every few seconds.
constexpr double shortest_period_s = 0.9e-3, longest_period_s = 8;
constexpr double disordered_share = 0.2;  // of the rows; restarts and repetitions cause less
constexpr double repeated_share = 0.01, gap_share = 0.05;
constexpr std::size_t most_named = 3;

struct Unit {
  const char* name;
  double factor;  // of us over it
};
constexpr std::array units{Unit{"ms", 1e3}, Unit{"s", 1e6}, Unit{"ns", 1e-3}};

double year_of(double utime_us) {
  return 1970 + utime_us / year_us;
}

// Reports a row period or year that is implausible in us and plausible in another unit; else an implausible
// year.
void check_unit(const CheckContext& c, std::vector<Check>& checks) {
  const double period = c.period_s();
  const double begin_us = static_cast<double>(c.seen.front().clock.first_us()), year = year_of(begin_us);
  const bool dated_in_us = year > earliest_year && year < latest_year;
  const auto sane = [&](double s) { return s > shortest_period_s && (s < longest_period_s || dated_in_us); };
  if (!(period > 0)) return;
  if (!sane(period) || year > latest_year) {
    const auto dated = [&](const Unit& unit) {
      const double then = year_of(begin_us * unit.factor);
      return then > earliest_year && then < latest_year;
    };
    const bool by_year = year > latest_year || std::ranges::any_of(units, dated);
    for (const Unit& unit : units) {
      if (!sane(period * unit.factor) || (by_year && !dated(unit))) continue;
      add_check(checks, "utime_scale", "utime", {1 / unit.factor}, true,
                "utime looks given in {}: rows would be {:.3g} s apart, in {} {:.3g} s; "
                "joulecast expects us since 1970.",
                unit.name, period, unit.name, period * unit.factor);
      return;
    }
  }
  if (year > latest_year)
    add_check(checks, "utime_year", "utime", {std::floor(year)}, false,
              "utime puts the recordings into the year {:.0f}, with rows every {:.3g} s: is it in ns, or "
              "from another epoch? joulecast expects us since 1970.",
              std::floor(year), period);
}

}  // namespace

void check_clock(const CheckContext& c, Checks& checks) {
  check_unit(c, checks);
  const auto total = [&](auto count) {
    return c.sum([&](const Observation& o) { return static_cast<double>(count(o.clock)); });
  };
  const double rows = total([](const ClockTally& t) { return t.rows(); });
  const double repeated = total([](const ClockTally& t) { return t.repeated(); });
  const double backward = total([](const ClockTally& t) { return t.backward(); });
  const double share = total([](const ClockTally& t) { return t.disordered(); }) / rows;
  if (share > disordered_share && total([](const ClockTally& t) { return t.counts(); }) > 0)
    add_check(
        checks, "two_senders", "utime", {share}, true,
        "In {:.0f} % of the rows the sequence number does not increase: two senders under one robot id? "
        "Each robot needs its own id and channel.",
        100 * share);
  const bool known = checks.empty();  // without the unit there are no seconds
  if (repeated + backward > repeated_share * rows)
    add_check(checks, "utime_order", "utime", {repeated + backward}, false,
              "{} rows have the time of the row before and {} an earlier one: utime must be the instant of "
              "sampling, and increase.",
              repeated, backward);
  if (!known) return;
  const double gap_s = total([](const ClockTally& t) { return t.gaps().seconds; });
  const double length_s = total([](const ClockTally& t) { return t.length_s(); });
  if (gap_s > gap_share * length_s)
    add_check(checks, "utime_gaps", "utime", {gap_s}, false,
              "{} gaps within missions total {:.0f} s of {:.0f} s; what happened in them is unknown.",
              total([](const ClockTally& t) { return t.gaps().count; }), gap_s, length_s);
  std::vector<std::string> names;
  for (const Observation& o : c.seen)
    if (o.clock.length_s() < telemetry::shortest_mission_s) names.push_back(o.mission_id);
  if (names.empty()) return;
  const std::size_t count = names.size();
  if (count > most_named) names.resize(most_named), names.emplace_back("...");
  add_check(checks, "short_missions", "", {static_cast<double>(count)}, false,
            "{} of {} missions are shorter than {:g} s and are not used: {}.", count, c.seen.size(),
            telemetry::shortest_mission_s, fmt::join(names, ", "));
}

}  // namespace joulecast::plausibility
