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

std::vector<Check> check_observations(std::span<const Observation> observations,
                                      const robot::RobotModel& robot) {
  if (observations.empty()) return {};
  const auto effects = dynamics::active_effects(robot);
  const dynamics::DriveModel model(robot, effects.value_or(std::vector<dynamics::ActiveEffect>{}));
  CheckContext context{observations, robot, model, motor_delay(observations).value_or(Delay{}).value_s};
  for (const Observation& o : observations) {
    for (std::size_t k = 0; k < reading_count; ++k) context.tallies[k].append(o.of(k));
  }
  std::vector<Check> checks;
  const auto take = [&](std::vector<Check> found) {
    for (Check& check : found) {
      if (check.contradicted) context.silent.push_back(check.channel);
      checks.push_back(std::move(check));
    }
  };
  take(check_clock(context));
  if (contradicts_clock(checks)) return checks;
  take(check_silence(context));
  take(check_signs_and_units(context));
  if (!effects) {
    checks.push_back(make_check("robot_file", "", {},
                                "The robot file's effects are left out: " + describe(effects.error()) + "."));
  }
  take(check_limits(context));
  take(check_motors(context));
  take(check_robot_file(context));
  take(check_kinematics(context));
  take(check_delays(context));
  take(check_steps(context));
  take(check_readings(context));
  shorten(checks);
  return checks;
}

std::vector<Check> check_recordings(const telemetry::RecordingSet& recordings,
                                    const robot::RobotModel& robot) {
  std::vector<Observation> observations;
  observations.reserve(recordings.missions.size());
  for (const telemetry::Recording& mission : recordings.missions) {
    observations.push_back(observe(mission, robot));
  }
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
