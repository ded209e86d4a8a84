#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

// The detector of changes of a robot: from each mission's findings alone, so that the whole history can be
// looked at often. Page, events, attention, forecasts, refinement, diagnoses and adoption all use its marks.
namespace joulecast::drift {

// What a change shows in; each mission's value is one over that of the model in force then.
enum class Quantity { energy, mass, battery_resistance };
inline constexpr std::size_t quantity_count = 3;
inline constexpr std::array<std::string_view, quantity_count> quantity_names{"energy", "mass",
                                                                             "battery_resistance"};

// One mission as the meter and the refinement accounted it.
struct MissionRatio {
  std::int64_t mission_key = 0;
  std::int64_t utime_us = 0;  // its start
  std::int64_t model_version = 0;
  double measured_j = 0;
  double modelled_j = 0;
  double mass = std::numeric_limits<double>::quiet_NaN();  // NaN: its motion does not show it
  double battery_resistance = std::numeric_limits<double>::quiet_NaN();

  double ratio() const { return measured_j / modelled_j; }
  bool usable() const { return measured_j > 0 && modelled_j > 0 && std::isfinite(ratio()); }
  std::array<double, quantity_count> ratios() const { return {ratio(), mass, battery_resistance}; }
};

// From this mission on, a ratio is another one than before, under the same model.
struct Mark {
  std::int64_t mission_key = 0;  // the first mission after the change
  std::int64_t utime_us = 0;
  std::int64_t model_version = 0;
  Quantity quantity = Quantity::energy;
  double before = 1, after = 1;      // mean ratios on both sides, from the missions that revealed it
  std::array<double, 2> interval{};  // of after - before, 95 %
  std::size_t missions = 0;          // after it, until the next mark or the end

  std::string_view quantity_name() const { return quantity_names[static_cast<std::size_t>(quantity)]; }
  double change() const { return after / before - 1; }
};

// Settings of the watch, the page and the adoption.
struct Settings {
  double least_change = 0.01;      // of the ratio: smaller changes are no drift
  std::size_t least_missions = 3;  // on each side of a mark
};

// Changes of the mean ratios, oldest first. Missions are compared within each model version, in the order of
// time, as if after each of them the missions since the last mark were tested: Student's t of the two sides
// of every place. A mark is set where they differ by more than chance over all places, quantities and looks
// allows (Bonferroni; the n-th look has 1/(n (n + 1)) of 1 %). Later missions move no mark, so that it has
// one date and one size.
std::vector<Mark> find_marks(std::span<const MissionRatio> missions, const Settings& settings);

}  // namespace joulecast::drift
