#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "plausibility/evaluation.h"
#include "plausibility/evidence.h"
#include "statistics/distributions.h"

namespace joulecast::plausibility {
namespace {

constexpr std::size_t fewest_missions = 3;  // on each side of a step
constexpr double least_step = 0.03;         // of the level
constexpr double most_unsure = 0.1;         // standard deviation over the level, of a level that counts
constexpr double false_alarms = 0.002;      // of one series of levels, over all positions tested

// One number of the robot in its missions.
struct Series {
  std::vector<std::size_t> mission;
  std::vector<double> level;
  std::string channel;
};

struct Step {
  std::size_t first = 0;  // mission after the step
  double before = 0, after = 0;
  Estimate change;  // relative to the level before
};

struct Mean {
  double value = 0, squares = 0;  // about it
};

Mean mean_of(std::span<const double> values) {
  Mean mean;
  for (const double v : values) mean.value += v / static_cast<double>(values.size());
  for (const double v : values) mean.squares += (v - mean.value) * (v - mean.value);
  return mean;
}

// Residual sum of squares of a straight line through levels at equal distances.
double squares_about_line(std::span<const double> values) {
  const double n = static_cast<double>(values.size());
  double slope = 0;
  for (std::size_t k = 0; k < values.size(); ++k)
    slope += (static_cast<double>(k) - 0.5 * (n - 1)) * values[k];
  return mean_of(values).squares - slope * slope * 12 / (n * (n * n - 1));
}

// The strongest lasting change of level that exceeds the scatter of missions at all positions tested
// (Bonferroni) and fits better than a linear trend.
std::optional<Step> find_step(std::span<const double> levels) {
  const std::size_t n = levels.size();
  if (n < 2 * fewest_missions) return std::nullopt;
  const double freedom = static_cast<double>(n - 2),
               places = static_cast<double>(n - 2 * fewest_missions + 1);
  const double floor = 1e-3 * std::fabs(mean_of(levels).value);
  Step best;
  double strongest = 0, least_squares = 0;
  for (std::size_t cut = fewest_missions; cut + fewest_missions <= n; ++cut) {
    const Mean before = mean_of(levels.first(cut)), after = mean_of(levels.subspan(cut));
    const double squares = before.squares + after.squares;
    const double error = std::sqrt(std::max(squares / freedom, floor * floor) *
                                   (1 / static_cast<double>(cut) + 1 / static_cast<double>(n - cut)));
    const double change = after.value - before.value;
    if (!(std::fabs(change) / error > strongest)) continue;
    strongest = std::fabs(change) / error;
    least_squares = squares;
    best = {cut, before.value, after.value,
            Estimate{change / before.value, error / std::fabs(before.value), freedom}};
  }
  const double bound = statistics::student_t_quantile(1 - 0.5 * false_alarms / places, freedom);
  if (strongest < bound || std::fabs(best.change.value) < least_step ||
      least_squares > squares_about_line(levels))
    return std::nullopt;
  return best;
}

// The lasting properties of the robot, by the sentence of their evidence.
std::map<std::string, Series> series_of(const CheckContext& c) {
  std::map<std::string, Series> all;
  for (std::size_t m = 0; m < c.seen.size(); ++m) {
    CheckContext one(c.seen.subspan(m, 1), c.robot, c.model);
    one.silent = c.silent;
    one.motor_delay_s = c.motor_delay_s;
    for (const ChannelEvidence& e : evidence_of(one)) {
      if (!is_lasting(e.property) || e.ratio.sd > most_unsure * std::fabs(e.ratio.value)) continue;
      Series& series = all[e.says];
      series.mission.push_back(m);
      series.level.push_back(e.ratio.value);
      for (const auto& [reading, power] : e.powers)
        if (power > 0 && reading < reading_count) series.channel = reading_names[reading];
    }
  }
  return all;
}

}  // namespace

void check_steps(const CheckContext& c, Checks& checks) {
  double strongest = 0;
  Checks found;
  for (const auto& [name, series] : series_of(c)) {
    const auto step = find_step(series.level);
    if (!step || std::fabs(step->change.value) / step->change.sd <= strongest) continue;
    strongest = std::fabs(step->change.value) / step->change.sd;
    const std::size_t first = series.mission[step->first], last = series.mission[step->first - 1];
    found.clear();
    add_check(
        found, "step_between_missions", series.channel, step->change, false,
        "From mission {} on, {} {:.4g} times the file's; until {} {:.4g} times ({:+.1f} %): diagnose the "
        "missions before and after separately.",
        c.seen[first].mission_id, name, step->after, c.seen[last].mission_id, step->before,
        100 * step->change.value)
        .first_mission = first;
  }
  std::ranges::move(found, std::back_inserter(checks));
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
