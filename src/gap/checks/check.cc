#include "gap/checks/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/checks/evaluation.h"
#include "gap/checks/motors.h"
#include "gap/checks/readings.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_checks = 12;

bool contradicts_clock(const std::vector<Check>& checks) {
  return std::ranges::any_of(checks, [](const Check& c) { return c.contradicted && c.channel == "utime"; });
}

// Contradictions first come, and stay; of the rest the least fundamental give way.
void shorten(std::vector<Check>& checks) {
  while (checks.size() > most_checks) {
    const auto last =
        std::ranges::find_if(checks.rbegin(), checks.rend(), [](const Check& c) { return !c.contradicted; });
    if (last == checks.rend()) return;
    checks.erase(std::next(last).base());
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

double CheckContext::period_s() const {
  std::vector<double> periods;
  for (const Observation& o : seen) {
    if (o.clock.period_s() > 0) periods.push_back(o.clock.period_s());
  }
  return periods.empty() ? 0 : statistics::median(std::move(periods));
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

// The drive with the effects that the catalogue accepts; Asking::ask_effects reports a file that it rejects.
dynamics::DriveModel drive_of(const robot::RobotModel& robot,
                              const Result<std::vector<dynamics::ActiveEffect>>& effects) {
  return {robot, effects ? *effects : std::vector<dynamics::ActiveEffect>{}};
}

// Checks that go on from one another: what one contradicts, the next do not ask again.
class Asking {
 public:
  Asking(std::span<const Observation> observations, const robot::RobotModel& robot, double motor_delay_s)
      : effects_(dynamics::active_effects(robot)),
        model_(drive_of(robot, effects_)),
        context_{observations, robot, model_, motor_delay_s} {
    for (const Observation& o : observations) {
      for (std::size_t k = 0; k < reading_count; ++k) context_.tallies[k].append(o.of(k));
    }
  }

  void ask(std::vector<Check> (*check)(const CheckContext&)) {
    for (Check& found : check(context_)) {
      if (found.contradicted) context_.silent.push_back(found.channel);
      checks.push_back(std::move(found));
    }
  }
  void ask_effects() {
    if (effects_) return;
    checks.push_back(make_check(
        "robot_file", "", {}, "The robot file's effects are left out: " + describe(effects_.error()) + "."));
  }

  std::vector<Check> checks;

 private:
  Result<std::vector<dynamics::ActiveEffect>> effects_;
  dynamics::DriveModel model_;
  CheckContext context_;
};

}  // namespace

std::vector<Check> check_observations(std::span<const Observation> observations,
                                      const robot::RobotModel& robot) {
  if (observations.empty()) return {};
  Asking asking(observations, robot, motor_delay(observations).value_or(Delay{}).value_s);
  asking.ask(check_clock);
  if (contradicts_clock(asking.checks)) return std::move(asking.checks);
  asking.ask(check_silence);
  asking.ask(check_signs_and_units);
  asking.ask_effects();
  for (const auto check : {check_limits, check_motors, check_robot_file, check_kinematics, check_delays,
                           check_steps, check_readings})
    asking.ask(check);
  shorten(asking.checks);
  return std::move(asking.checks);
}

std::vector<Check> check_contradictions(std::span<const Observation> observations,
                                        const robot::RobotModel& robot) {
  if (observations.empty()) return {};
  Asking asking(observations, robot, 0);
  asking.ask(check_clock);
  if (!contradicts_clock(asking.checks)) {
    for (const auto check : {check_silence, check_signs_and_units, check_limits, check_readings})
      asking.ask(check);
  }
  std::erase_if(asking.checks, [](const Check& c) {
    return !c.contradicted && !c.id.ends_with("_over_limit") && c.id != "thrown_readings" &&
           c.id != "utime_order" && c.id != "utime_year";
  });
  return std::move(asking.checks);
}

std::vector<Check> check_recordings(const telemetry::RecordingSet& recordings,
                                    const robot::RobotModel& robot) {
  std::vector<Observation> observations;
  observations.reserve(recordings.missions.size());
  const dynamics::DriveModel drive = drive_of(robot, dynamics::active_effects(robot));
  for (const telemetry::Recording& mission : recordings.missions)
    observations.push_back(observe(mission, robot, drive));
  return check_observations(observations, robot);
}

void silence_contradicted(telemetry::RecordingSet& recordings, std::span<const Check> checks) {
  std::array<bool, reading_count> silent{};
  for (const Check& check : checks) {
    for (std::size_t k = 0; k < reading_count; ++k) {
      if (check.contradicted && belongs_to(reading_names[k], check.channel)) silent[k] = true;
    }
  }
  if (std::ranges::none_of(silent, [](bool s) { return s; })) return;
  for (telemetry::Recording& mission : recordings.missions) {
    for (signals::Sample& sample : mission.samples) {
      const auto readings = signals::numbers_of(sample);
      for (std::size_t k = 0; k < reading_count; ++k) {
        if (silent[k]) *readings[k] = signals::unmeasured;
      }
    }
  }
}

}  // namespace joulecast::gap
