#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

// How a robot's gap moves over its missions: from each mission's measured and modelled energy alone, so that
// the whole history can be looked at often.
namespace joulecast::drift {

// One mission as the meter accounted it.
struct MissionRatio {
  std::int64_t mission_key = 0;
  std::int64_t utime_us = 0;  // its start
  std::int64_t model_version = 0;
  double measured_j = 0;
  double modelled_j = 0;

  double ratio() const { return measured_j / modelled_j; }
  bool usable() const { return measured_j > 0 && modelled_j > 0 && std::isfinite(ratio()); }
};

// From this mission on, the ratio is another one than before, under the same model.
struct Mark {
  std::int64_t mission_key = 0;  // the first mission after the change
  std::int64_t utime_us = 0;
  std::int64_t model_version = 0;
  double before = 1, after = 1;      // mean ratios of the segments on both sides
  std::array<double, 2> interval{};  // of after - before, 95 %
  std::size_t missions = 0;          // after it, until the next mark or the end
};

// Settings of the watch, the page and the adoption.
struct Settings {
  double least_change = 0.01;      // of the ratio: smaller changes are no drift
  std::size_t least_missions = 3;  // on each side of a mark
};

// Changes of the mean ratio, oldest first. Missions are compared within each model version, in the order of
// time. Their scatter comes from differences of neighbours, so that a drift does not increase it. A mark is
// set where the two sides differ by more than chance over all tested places allows (Bonferroni, 1 % per
// segment).
std::vector<Mark> find_marks(std::span<const MissionRatio> missions, const Settings& settings);

}  // namespace joulecast::drift
