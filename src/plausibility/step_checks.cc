#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "plausibility/evaluation.h"
#include "plausibility/motors.h"
#include "statistics/distributions.h"
#include "statistics/robust.h"

namespace joulecast::plausibility {
namespace {

constexpr std::size_t fewest_missions = 3;  // on each side of a step
constexpr double least_step = 0.03;         // of the level
constexpr double most_unsure = 0.1;         // standard deviation over the level, of a level that counts
constexpr double false_alarms = 0.002;      // of one series of levels, over all positions tested

struct Step {
  std::size_t first = 0;  // mission after the step
  double before = 0, after = 0;
  Estimate change;  // relative to the level before
};

double mean(std::span<const double> values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

double squares_about(std::span<const double> values, double centre) {
  double sum = 0;
  for (const double v : values) sum += (v - centre) * (v - centre);
  return sum;
}

// Residual sum of squares of a straight line through levels at equal distances.
double squares_about_line(std::span<const double> values) {
  const double n = static_cast<double>(values.size()), centre = mean(values);
  double slope = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    slope += (static_cast<double>(k) - 0.5 * (n - 1)) * (values[k] - centre);
  }
  const double spread = n * (n * n - 1) / 12;
  return squares_about(values, centre) - slope * slope / spread;
}

// The strongest lasting change of level that exceeds the scatter of missions at all positions tested
// (Bonferroni) and fits better than a linear trend.
std::optional<Step> find_step(std::span<const double> levels) {
  const std::size_t n = levels.size();
  if (n < 2 * fewest_missions) return std::nullopt;
  const double level = mean(levels);
  if (!(std::fabs(level) > 0)) return std::nullopt;
  std::optional<Step> best;
  double strongest = 0, least_squares = 0;
  for (std::size_t cut = fewest_missions; cut + fewest_missions <= n; ++cut) {
    const auto left = levels.first(cut), right = levels.subspan(cut);
    const double before = mean(left), after = mean(right);
    const double squares = squares_about(left, before) + squares_about(right, after);
    const double freedom = static_cast<double>(n - 2);
    const double floor = 1e-3 * std::fabs(level);
    const double error = std::sqrt(std::max(squares / freedom, floor * floor) *
                                   (1 / static_cast<double>(cut) + 1 / static_cast<double>(n - cut)));
    if (const double t = std::fabs(after - before) / error; t > strongest) {
      strongest = t;
      least_squares = squares;
      best = {cut, before, after, Estimate{(after - before) / before, error / std::fabs(before), freedom}};
    }
  }
  const double places = static_cast<double>(n - 2 * fewest_missions + 1);
  const double bound =
      statistics::student_t_quantile(1 - 0.5 * false_alarms / places, static_cast<double>(n - 2));
  if (strongest < bound || std::fabs(best->change.value) < least_step) return std::nullopt;
  if (least_squares > squares_about_line(levels)) return std::nullopt;
  return best;
}

struct Level {
  std::string name, channel;
  Estimate value;
};

// Levels estimated from one mission alone: the same ones in the same order from each mission.
std::vector<Level> levels_of(const CheckContext& c, const Observation& o) {
  const bool battery = c.heard({reading::battery_voltage, reading::battery_current});
  const bool motors = c.heard({0, 1, 2, 3, 4, 5}), currents = c.heard({0, 1, 4, 5});
  std::vector<Level> levels;
  if (battery && c.heard({0, 1}))
    levels.push_back({"battery power over the model's", "battery_current",
                      ratio_of_sums(o.of(Relation::driving).blocks(), 0, 1, 2)});
  if (battery)
    levels.push_back(
        {"idle power", "battery_current", ratio_of_sums(o.of(Relation::idle).blocks(), 0, 1, 1)});
  const auto constants = motor_constants({&o, 1}, c.motor_delay_s);
  for (std::size_t k : {0u, 1u}) {
    const MotorConstants& m = constants[k];
    const std::string side = side_name[k], motor = " of the " + side + " motor";
    if (motors) levels.push_back({"resistance" + motor, "motor_voltage." + side, m.resistance_ohm});
    if (motors) levels.push_back({"voltage constant" + motor, "motor_voltage." + side, m.constant_v_s_rad});
    if (currents) levels.push_back({"steady current" + motor, "motor_current." + side, m.steady_current_a});
  }
  return levels;
}

}  // namespace

void check_steps(const CheckContext& c, Checks& checks) {
  std::optional<Step> strongest;
  Check check;
  std::vector<std::vector<Level>> of_missions;
  for (const Observation& o : c.seen) of_missions.push_back(levels_of(c, o));
  for (std::size_t n = 0; n < of_missions.front().size(); ++n) {
    const Level& series = of_missions.front()[n];
    std::vector<double> known;
    std::vector<std::size_t> mission;
    for (std::size_t k = 0; k < of_missions.size(); ++k) {
      const Estimate& e = of_missions[k][n].value;
      if (e.known() && e.sd < most_unsure * std::fabs(e.value))
        known.push_back(e.value), mission.push_back(k);
    }
    const auto step = find_step(known);
    if (!step) continue;
    const auto strength = [](const Step& s) { return std::fabs(s.change.value) / s.change.sd; };
    if (strongest && strength(*strongest) >= strength(*step)) continue;
    strongest = step;
    const Observation& last = c.seen[mission[step->first - 1]];
    const Observation& first = c.seen[mission[step->first]];
    check = make_check(
        "step_between_missions", series.channel, step->change,
        fmt::format(
            "From mission {} on, the {} is {:.4g} instead of {:.4g} ({:+.1f} %), and was so until {}: "
            "diagnose the missions on each side separately.",
            first.mission_id, series.name, step->after, step->before, 100 * step->change.value,
            last.mission_id));
    check.first_mission = mission[step->first];
  }
  if (strongest) checks.push_back(std::move(check));
}

std::optional<std::array<telemetry::RecordingSet, 2>> split_at_step(const telemetry::RecordingSet& recordings,
                                                                    std::span<const Check> checks) {
  const auto step = std::ranges::find_if(checks, [](const Check& c) { return c.first_mission.has_value(); });
  if (step == checks.end()) return std::nullopt;
  std::array<telemetry::RecordingSet, 2> sides;
  for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
    telemetry::RecordingSet& side = sides[m < *step->first_mission ? 0 : 1];
    side.samples += recordings.missions[m].samples.size();
    side.missions.push_back(recordings.missions[m]);
  }
  for (telemetry::RecordingSet& side : sides) side.robot_id = recordings.robot_id;
  return sides;
}

}  // namespace joulecast::plausibility
