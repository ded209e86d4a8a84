#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "plausibility/evaluation.h"
#include "statistics/robust.h"

namespace joulecast::plausibility {
namespace {

constexpr double year_us = 365.25 * 86400e6;
constexpr double earliest_year = 1990, latest_year = 2100;
// Robots record at most 1000 rows a second, and recordings without a date at least one every few seconds.
constexpr double shortest_period_s = 0.9e-3, longest_period_s = 8;
constexpr double disordered_share = 0.2;  // of the rows; restarts and repetitions cause less
constexpr double repeated_share = 0.01, gap_share = 0.05;

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
      add_check(
          checks, "utime_scale", "utime", 1 / unit.factor, true,
          "utime looks given in {}: its rows would come every {:.3g} s, in {} every {:.3g} s; joulecast "
          "expects us since 1970.",
          unit.name, period, unit.name, period * unit.factor);
      return;
    }
  }
  if (year > latest_year)
    add_check(
        checks, "utime_year", "utime", std::floor(year), false,
        "utime puts the recordings into the year {:.0f}, with rows every {:.3g} s: is it in ns, or from "
        "another epoch? joulecast expects us since 1970.",
        std::floor(year), period);
}

}  // namespace

void check_clock(const CheckContext& c, Checks& checks) {
  check_unit(c, checks);
  std::size_t rows = 0, repeated = 0, backward = 0, disordered = 0, gaps = 0, short_ones = 0;
  double gap_s = 0, length_s = 0;
  bool counts = false;
  std::string names;
  for (const Observation& o : c.seen) {
    rows += o.clock.rows();
    repeated += o.clock.repeated();
    backward += o.clock.backward();
    disordered += o.clock.disordered();
    counts = counts || o.clock.counts();
    if (!checks.empty()) continue;  // without the unit there are no seconds
    gaps += o.clock.gaps().count;
    gap_s += o.clock.gaps().seconds;
    length_s += o.clock.length_s();
    if (o.clock.length_s() >= telemetry::shortest_mission_s) continue;
    if (++short_ones <= 3) names += (names.empty() ? "" : ", ") + o.mission_id;
  }
  const double n = static_cast<double>(rows);
  if (const double share = static_cast<double>(disordered) / n; counts && share > disordered_share)
    add_check(
        checks, "two_senders", "utime", share, true,
        "In {:.0f} % of the rows the sequence number does not go up: two senders under one robot id? Each "
        "robot needs its own id and channel.",
        100 * share);
  if (const auto wrong = static_cast<double>(repeated + backward); wrong > repeated_share * n)
    add_check(
        checks, "utime_order", "utime", wrong, false,
        "{} rows are stamped like the row before and {} before it: utime must be the instant of sampling, "
        "and only go forward.",
        repeated, backward);
  if (gap_s > gap_share * length_s)
    add_check(
        checks, "utime_gaps", "utime", gap_s, false,
        "{} silences within missions make up {:.0f} s of {:.0f} s; nothing is known of what happened in "
        "them.",
        gaps, gap_s, length_s);
  if (short_ones > 0)
    add_check(checks, "short_missions", "", static_cast<double>(short_ones), false,
              "{} of {} missions are shorter than {:g} s and are not used: {}{}.", short_ones, c.seen.size(),
              telemetry::shortest_mission_s, names, short_ones > 3 ? ", ..." : "");
}

}  // namespace joulecast::plausibility
