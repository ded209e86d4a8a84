#include "plausibility/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>

#include "plausibility/evaluation.h"
#include "plausibility/readings.h"
#include "statistics/robust.h"
#include "telemetry/impossible.h"

namespace joulecast::plausibility {
namespace {

constexpr double not_known = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t most_checks = 12, most_missions_named = 3;
constexpr double min_mission_moving_s = 10;  // of a mission, for a contradiction from it alone

bool contradicts_clock(const std::vector<Check>& checks) {
  return std::ranges::any_of(checks, [](const Check& c) { return c.contradicted && c.channel == "utime"; });
}

// Keeps all contradictions; removes the least fundamental of the other checks, which are the last.
void shorten(std::vector<Check>& checks) {
  while (checks.size() > most_checks) {
    const auto last =
        std::ranges::find_if(checks.rbegin(), checks.rend(), [](const Check& c) { return !c.contradicted; });
    if (last == checks.rend()) return;
    checks.erase(std::next(last).base());
  }
}

// The checks in sequence: channels contradicted by one check are not used by the next.
std::vector<Check> run_checks(CheckContext context,
                              std::initializer_list<void (*)(const CheckContext&, Checks&)> some) {
  std::vector<Check> checks;
  for (const auto check : some) {
    const std::size_t before = checks.size();
    check(context, checks);
    if (contradicts_clock(checks)) break;
    for (std::size_t n = before; n < checks.size(); ++n)
      if (checks[n].contradicted) {
        const bool radius = checks[n].channel == radius_of_file;  // the way of the wheels is not known
        for (const std::size_t k : readings_of(radius ? "wheel_velocity" : checks[n].channel))
          context.silent |= 1u << k;
        context.evidence.reset();
      }
  }
  return checks;
}

void check_effects(const CheckContext& c, Checks& checks) {
  if (const auto effects = dynamics::active_effects(c.robot); !effects)
    add_check(checks, "robot_file", "", {}, false, "The robot file's effects are left out: {}.",
              describe(effects.error()));
}

// `recordings`: those of the observations.
std::vector<Check> check_together(const std::vector<Observation>& observations,
                                  const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                                  const dynamics::DriveModel& drive) {
  if (observations.empty()) return {};
  std::vector<Check> checks = run_checks(
      {observations, robot, drive, recordings.missions},
      {check_clock, check_silence, check_leaps, check_faults, check_effects, check_limits, check_motors,
       check_robot_file, check_kinematics, check_delays, check_steps, check_spikes, check_readings});
  shorten(checks);
  return checks;
}

std::vector<Observation> observe_all(const telemetry::RecordingSet& recordings,
                                     const robot::RobotModel& robot, const dynamics::DriveModel& drive) {
  std::vector<Observation> observations;
  for (const telemetry::Recording& mission : recordings.missions)
    observations.push_back(observe(mission, robot, drive));
  return observations;
}

// Constant wheel readings do not show how long the robot moves; the mission's length is used instead.
bool tells_by_itself(const Observation& o) {
  const bool level = o.values[0].constant() && o.values[1].constant();
  return (level ? o.clock.length_s() : o.moving_s) >= min_mission_moving_s;
}

// Contradictions found in each mission alone, except those of the clock.
std::vector<Check> asked_one_by_one(const std::vector<Observation>& observations,
                                    const robot::RobotModel& robot) {
  std::vector<Check> found;
  for (std::size_t m = 0; m < observations.size(); ++m) {
    if (!tells_by_itself(observations[m])) continue;
    for (Check& check : check_contradictions({&observations[m], 1}, robot)) {
      if (!check.contradicted || check.channel == "utime") continue;
      const auto same = std::ranges::find_if(
          found, [&](const Check& c) { return c.id == check.id && c.channel == check.channel; });
      (same == found.end() ? found.emplace_back(std::move(check)) : *same).few_missions.push_back(m);
    }
  }
  return found;
}

// Contradictions in at most half of the missions. If all missions were checked together, the others would
// hide them or be contradicted with them. Contradictions in more missions are reported for all missions, and
// their channels are corrected, or not used as evidence, here.
std::vector<Check> wrong_in_few(const telemetry::RecordingSet& recordings,
                                const std::vector<Observation>& observations, const robot::RobotModel& robot,
                                const dynamics::DriveModel& drive) {
  const std::size_t most = observations.size() / 2;
  std::vector<Check> found = asked_one_by_one(observations, robot);
  std::vector<Check> in_most;
  for (const Check& c : found)
    if (c.few_missions.size() > most) in_most.push_back(c), in_most.back().few_missions.clear();
  if (!in_most.empty()) {
    telemetry::RecordingSet others = recordings;
    silence_contradicted(others, in_most);
    found = asked_one_by_one(observe_all(others, robot, drive), robot);
    const auto field = [](const Check& c) { return c.channel.substr(0, c.channel.find_first_of(".,")); };
    std::erase_if(found, [&](const Check& c) {
      return std::ranges::any_of(in_most, [&](const Check& other) { return field(c) == field(other); });
    });
  }
  std::set<std::size_t> wrong;
  for (const Check& c : found) wrong.insert(c.few_missions.begin(), c.few_missions.end());
  if (wrong.size() > most) return {};
  for (Check& c : found) {
    std::string names;
    for (std::size_t k = 0; k < std::min(c.few_missions.size(), most_missions_named); ++k)
      names += (k > 0 ? ", " : "") + observations[c.few_missions[k]].mission_id;
    c.says = fmt::format("In {} of {} missions ({}{}): {}", c.few_missions.size(), observations.size(), names,
                         c.few_missions.size() > most_missions_named ? ", ..." : "", c.says);
  }
  return found;
}

}  // namespace

CheckContext::CheckContext(std::span<const Observation> observations, const robot::RobotModel& of,
                           const dynamics::DriveModel& drive,
                           std::span<const telemetry::Recording> recordings)
    : seen(observations), robot(of), model(drive), missions(recordings), lags(recordings) {
  for (const Observation& o : seen)
    for (std::size_t k = 0; k < reading_count; ++k) tallies[k].append(o.values[k]);
  if (!missions.empty()) held_s = held_times(missions, period_s());
  motor_delay_s = missions.empty() ? not_known : motor_delay(*this).value_or(Delay{}).value_s;
}

double CheckContext::usual(const std::function<double(const Observation&)>& of) const {
  std::vector<double> known;
  for (const Observation& o : seen)
    if (const double value = of(o); value > 0) known.push_back(value);
  return known.empty() ? 0 : statistics::median(std::move(known));
}

double CheckContext::sum(const std::function<double(const Observation&)>& of) const {
  double sum = 0;
  for (const Observation& o : seen) sum += of(o);
  return sum;
}

std::string with_interval(double value, const std::array<double, 2>& interval) {
  if (!std::isfinite(interval[0]) || interval[1] - interval[0] < 1e-3 * std::fabs(value))
    return fmt::format("{:.3g}", value);
  return fmt::format("{:.3g} ({:.3g} to {:.3g})", value, interval[0], interval[1]);
}

std::vector<Check> check_contradictions(std::span<const Observation> observations,
                                        const robot::RobotModel& robot) {
  const dynamics::DriveModel model = drive_of(robot);
  std::vector<Check> checks =
      run_checks({observations, robot, model},
                 {check_clock, check_silence, check_leaps, check_faults, check_limits, check_spikes});
  std::erase_if(checks, [](const Check& c) {
    return !c.contradicted && !c.id.ends_with("_over_limit") && c.id != "thrown_readings" &&
           c.id != "utime_order" && c.id != "utime_year";
  });
  return checks;
}

std::vector<Check> check_recordings(const telemetry::RecordingSet& recordings,
                                    const robot::RobotModel& robot) {
  if (std::vector<Check> checks = check_ranges(recordings); !checks.empty()) {
    telemetry::RecordingSet rest = recordings;
    rest.beyond_range.clear();
    silence_contradicted(rest, checks);
    std::ranges::move(check_recordings(rest, robot), std::back_inserter(checks));
    return checks;
  }
  const dynamics::DriveModel drive = drive_of(robot);
  std::vector<Observation> observations = observe_all(recordings, robot, drive);
  std::vector<Check> checks = wrong_in_few(recordings, observations, robot, drive), of_all;
  if (checks.empty()) {
    of_all = check_together(observations, recordings, robot, drive);
  } else {
    telemetry::RecordingSet rest = recordings;
    silence_contradicted(rest, checks);
    of_all = check_together(observe_all(rest, robot, drive), rest, robot, drive);
  }
  std::ranges::move(of_all, std::back_inserter(checks));
  return checks;
}

std::vector<Check> drop_impossible(telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  std::vector<Check> checks;
  for (const telemetry::DroppedReadings& dropped : telemetry::drop_impossible(recordings.missions, robot))
    add_check(checks, "impossible_readings", dropped.channel, {static_cast<double>(dropped.samples)}, false,
              "{} of {} samples count as not measured: {}.", dropped.samples, recordings.samples,
              dropped.why);
  return checks;
}

void silence_contradicted(telemetry::RecordingSet& recordings, std::span<const Check> checks) {
  for (const bool swap : {true, false})  // sides are exchanged first
    for (const Check& check : checks) {
      if (!check.contradicted || check.swapped != swap) continue;
      const std::vector<std::size_t> wrong = readings_of(check.channel);
      for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
        if (!check.few_missions.empty() && std::ranges::count(check.few_missions, m) == 0) continue;
        for (signals::Sample& sample : recordings.missions[m].samples) {
          const auto readings = signals::numbers_of(sample);
          for (const std::size_t k : wrong) {
            if (!swap)
              *readings[k] /= check.factor.value_or(not_known);
            else if (k % 2 == 0)
              std::swap(*readings[k], *readings[k + 1]);
          }
        }
      }
    }
}

}  // namespace joulecast::plausibility
