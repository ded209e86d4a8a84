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

bool holds_for(const Check& check, std::size_t mission) {
  return check.few_missions.empty() || std::ranges::count(check.few_missions, mission) > 0;
}

// Divisors of a mission's readings, NaN for contradicted ones, and the pairs that are exchanged
// first.
struct Repair {
  std::array<double, reading_count> divisor;
  std::array<bool, reading_count / 2> swapped{};
};

Repair repair_of(std::span<const Check> checks, std::size_t mission) {
  Repair repair;
  repair.divisor.fill(1);
  for (const Check& check : checks) {
    if (!check.contradicted || !holds_for(check, mission)) continue;
    for (std::size_t k = 0; k < reading_count; ++k) {
      if (!belongs_to(reading_names[k], check.channel)) continue;
      if (check.swapped)
        repair.swapped[k / 2] = true;
      else
        repair.divisor[k] *= check.factor.value_or(not_known);
    }
  }
  return repair;
}

void silence(telemetry::Recording& mission, const Repair& repair) {
  if (std::ranges::count(repair.divisor, 1) == reading_count && std::ranges::count(repair.swapped, true) == 0)
    return;
  for (signals::Sample& sample : mission.samples) {
    const auto readings = signals::numbers_of(sample);
    for (std::size_t k = 0; k < reading_count; ++k) {
      if (k % 2 == 0 && repair.swapped[k / 2]) std::swap(*readings[k], *readings[k + 1]);
      *readings[k] /= repair.divisor[k];
    }
  }
}

}  // namespace

bool CheckContext::heard(std::initializer_list<std::size_t> readings) const {
  return std::ranges::none_of(readings, [&](std::size_t k) {
    return std::ranges::any_of(silent, [&](const auto& s) { return belongs_to(reading_names[k], s); });
  });
}

bool CheckContext::has(std::initializer_list<std::size_t> readings) const {
  return heard(readings) &&
         std::ranges::all_of(readings, [&](std::size_t k) { return tally(k).known() > 0; });
}

double CheckContext::usual(const std::function<double(const Observation&)>& of) const {
  std::vector<double> known;
  for (const Observation& o : seen)
    if (const double value = of(o); value > 0) known.push_back(value);
  return known.empty() ? 0 : statistics::median(std::move(known));
}

Estimate CheckContext::friction_ratio(std::size_t k) const {
  const dynamics::Parameters<double>& p = model.parameters();
  const double torque = p.friction_torque_nm[k] + p.viscous_friction_nm_s_rad * motors[k].mean_speed_rad_s;
  return torque > 0 ? motors[k].steady_current_a * (p.torque_constant_nm_a / torque) : Estimate{};
}

double CheckContext::moving_s() const {
  double sum = 0;
  for (const Observation& o : seen) sum += o.moving_s;
  return sum;
}

std::string with_interval(double value, const std::array<double, 2>& interval) {
  if (!std::isfinite(interval[0]) || interval[1] - interval[0] < 1e-3 * std::fabs(value)) {
    return fmt::format("{:.3g}", value);
  }
  return fmt::format("{:.3g} ({:.3g} to {:.3g})", value, interval[0], interval[1]);
}

Check make_check(std::string id, std::string channel, const Estimate& value, std::string says) {
  return {std::move(id), std::move(channel), value.value, value.interval(), std::move(says), false};
}

namespace {

// The drive with the effects that the catalogue accepts.
dynamics::DriveModel drive_of(const robot::RobotModel& robot,
                              const Result<std::vector<dynamics::ActiveEffect>>& effects) {
  return {robot, effects ? *effects : std::vector<dynamics::ActiveEffect>{}};
}

// All checks in sequence, or those of one mission without delays: channels contradicted by one check are not
// used by the next.
std::vector<Check> run_checks(std::span<const Observation> seen, const robot::RobotModel& robot, bool all) {
  if (seen.empty()) return {};
  const double delay_s = all ? motor_delay(seen).value_or(Delay{}).value_s : not_known;
  const auto effects = dynamics::active_effects(robot);
  const dynamics::DriveModel model = drive_of(robot, effects);
  CheckContext context{seen, robot, model, delay_s, motor_constants(seen, delay_s)};
  for (const Observation& o : seen)
    for (std::size_t k = 0; k < reading_count; ++k) context.tallies[k].append(o.of(k));
  std::vector<Check> checks;
  const auto run = [&](std::initializer_list<void (*)(const CheckContext&, Checks&)> some) {
    for (const auto check : some) {
      const std::size_t before = checks.size();
      check(context, checks);
      for (std::size_t k = before; k < checks.size(); ++k)
        if (checks[k].contradicted) context.silent.push_back(checks[k].channel);
    }
  };
  run({check_clock});
  if (contradicts_clock(checks)) return checks;
  run({check_silence, check_wheels, check_signs_and_units});
  if (all && !effects)
    checks.push_back(make_check("robot_file", "", {},
                                "The robot file's effects are left out: " + describe(effects.error()) + "."));
  run({check_limits});
  if (all) run({check_motors, check_robot_file, check_kinematics, check_delays, check_steps});
  run({check_readings});
  return checks;
}

}  // namespace

std::vector<Check> check_observations(std::span<const Observation> observations,
                                      const robot::RobotModel& robot) {
  std::vector<Check> checks = run_checks(observations, robot, true);
  if (!contradicts_clock(checks)) shorten(checks);
  return checks;
}

std::vector<Check> check_contradictions(std::span<const Observation> observations,
                                        const robot::RobotModel& robot) {
  std::vector<Check> checks = run_checks(observations, robot, false);
  std::erase_if(checks, [](const Check& c) {
    return !c.contradicted && !c.id.ends_with("_over_limit") && c.id != "thrown_readings" &&
           c.id != "utime_order" && c.id != "utime_year";
  });
  return checks;
}

namespace {

std::vector<Observation> observe_all(const telemetry::RecordingSet& recordings,
                                     const robot::RobotModel& robot, const dynamics::DriveModel& drive) {
  std::vector<Observation> observations;
  observations.reserve(recordings.missions.size());
  for (const telemetry::Recording& mission : recordings.missions)
    observations.push_back(observe(mission, robot, drive));
  return observations;
}

// Constant wheel readings do not show how long the robot moves; the mission's length is used instead.
bool tells_by_itself(const Observation& o) {
  const bool level = o.of(reading::wheel_velocity).constant() && o.of(reading::wheel_velocity + 1).constant();
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

// True if both checks concern one field, e.g. its two sides.
bool of_one_field(const Check& a, const Check& b) {
  const auto field = [](std::string_view reading) { return reading.substr(0, reading.find('.')); };
  return std::ranges::any_of(reading_names, [&](std::string_view of_a) {
    return belongs_to(of_a, a.channel) && std::ranges::any_of(reading_names, [&](std::string_view of_b) {
             return belongs_to(of_b, b.channel) && field(of_a) == field(of_b);
           });
  });
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
  for (const Check& c : found) {
    if (c.few_missions.size() > most) in_most.push_back(c), in_most.back().few_missions.clear();
  }
  if (!in_most.empty()) {
    telemetry::RecordingSet others = recordings;
    silence_contradicted(others, in_most);
    found = asked_one_by_one(observe_all(others, robot, drive), robot);
    std::erase_if(found, [&](const Check& c) {
      return std::ranges::any_of(in_most, [&](const Check& other) { return of_one_field(c, other); });
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

std::vector<Check> check_recordings(const telemetry::RecordingSet& recordings,
                                    const robot::RobotModel& robot) {
  if (std::vector<Check> checks = check_ranges(recordings); !checks.empty()) {
    telemetry::RecordingSet rest = recordings;
    rest.beyond_range.clear();
    silence_contradicted(rest, checks);
    std::ranges::move(check_recordings(rest, robot), std::back_inserter(checks));
    return checks;
  }
  const dynamics::DriveModel drive = drive_of(robot, dynamics::active_effects(robot));
  std::vector<Observation> observations = observe_all(recordings, robot, drive);
  std::vector<Check> checks = wrong_in_few(recordings, observations, robot, drive);
  for (std::size_t m = 0; m < observations.size(); ++m) {
    if (std::ranges::none_of(checks, [&](const Check& c) { return holds_for(c, m); })) continue;
    telemetry::Recording mission = recordings.missions[m];
    silence(mission, repair_of(checks, m));
    observations[m] = observe(mission, robot, drive);
  }
  const std::vector<Check> of_all = check_observations(observations, robot);
  checks.insert(checks.end(), of_all.begin(), of_all.end());
  return checks;
}

std::vector<Check> drop_impossible(telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  std::vector<Check> checks;
  for (const telemetry::DroppedReadings& dropped : telemetry::drop_impossible(recordings.missions, robot))
    checks.push_back({"impossible_readings",
                      dropped.channel,
                      static_cast<double>(dropped.samples),
                      {not_known, not_known},
                      fmt::format("{} of {} samples count as not measured: {}.", dropped.samples,
                                  recordings.samples, dropped.why)});
  return checks;
}

void silence_contradicted(telemetry::RecordingSet& recordings, std::span<const Check> checks) {
  for (std::size_t m = 0; m < recordings.missions.size(); ++m)
    silence(recordings.missions[m], repair_of(checks, m));
}

}  // namespace joulecast::plausibility
