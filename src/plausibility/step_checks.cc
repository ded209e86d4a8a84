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

struct Series {
  std::string name, channel;
  std::vector<double> levels;  // NaN: unknown in that mission
};

// Levels estimated from each mission alone.
std::vector<Series> levels_of(const CheckContext& c) {
  const bool battery = c.heard({reading::battery_voltage, reading::battery_current});
  const bool motors = c.heard({0, 1, 2, 3, 4, 5}), currents = c.heard({0, 1, 4, 5});
  std::vector<Series> series;
  if (battery && c.heard({0, 1})) series.push_back({"battery power over the model's", "battery_current", {}});
  if (battery) series.push_back({"idle power", "battery_current", {}});
  for (const char* side : {"right", "left"}) {
    if (motors)
      series.push_back(
          {fmt::format("resistance of the {} motor", side), fmt::format("motor_voltage.{}", side), {}});
    if (motors)
      series.push_back(
          {fmt::format("voltage constant of the {} motor", side), fmt::format("motor_voltage.{}", side), {}});
    if (currents)
      series.push_back(
          {fmt::format("steady current of the {} motor", side), fmt::format("motor_current.{}", side), {}});
  }
  constexpr double most_unsure = 0.1;  // standard deviation over the level
  for (const Observation& o : c.seen) {
    const std::span one(&o, 1);
    const auto level = [&](const Estimate& e) {
      const bool known = e.known() && e.sd < most_unsure * std::fabs(e.value);
      return known ? e.value : std::numeric_limits<double>::quiet_NaN();
    };
    const auto m = motor_constants(one, c.motor_delay_s);
    auto next = series.begin();
    const auto push = [&](const Estimate& e) { (next++)->levels.push_back(level(e)); };
    if (battery && c.heard({0, 1})) push(ratio_of_sums(o.of(Relation::driving).blocks(), 0, 1, 2));
    if (battery) push(ratio_of_sums(o.of(Relation::idle).blocks(), 0, 1, 1));
    for (const MotorConstants& motor : m) {
      if (motors) push(motor.resistance_ohm), push(motor.constant_v_s_rad);
      if (currents) push(motor.steady_current_a);
    }
  }
  return series;
}

}  // namespace

std::vector<Check> check_steps(const CheckContext& c) {
  std::optional<Step> strongest;
  Check check;
  for (const Series& series : levels_of(c)) {
    std::vector<double> known;
    std::vector<std::size_t> mission;
    for (std::size_t k = 0; k < series.levels.size(); ++k) {
      if (std::isfinite(series.levels[k])) known.push_back(series.levels[k]), mission.push_back(k);
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
  if (!strongest) return {};
  return {check};
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
