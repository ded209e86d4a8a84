#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "plausibility/evaluation.h"
#include "statistics/updates.h"

namespace joulecast::plausibility {
namespace {

constexpr std::size_t fewest_spikes = 3;
constexpr std::size_t fewest_leaps = 2;  // there and back
constexpr double least_held = 1.5;       // periods of rows; below, a reading is new in each row
constexpr double slowest = 100;          // rows between values of a working sensor
constexpr double lost_share = 0.5;
constexpr double biased_share = 0.1;  // of the samples; beyond, the remaining samples are biased

// Channels that are used in equations, and the gyro.
bool is_used(std::size_t k) {
  return k <= reading::battery_current || k == reading::yaw_rate;
}

// Share of a reading's rows in gaps longer than those of a slow sensor.
double lost_rows(const CheckContext& c, std::size_t reading) {
  double count = 0, lost = 0;
  for (const telemetry::Recording& mission : c.missions) {
    double missing = 0;
    const auto end_gap = [&] {
      if (missing > slowest) lost += missing;
      missing = 0;
    };
    for (const signals::Sample& s : mission.samples) {
      if (std::isfinite(*signals::numbers_of(s)[reading]))
        end_gap();
      else
        ++missing;
    }
    end_gap();
    count += static_cast<double>(mission.samples.size());
  }
  return lost / count;
}

void add_to(std::string& list, std::string_view text) {
  list.append(list.empty() ? "" : ", ").append(text);
}

void check_held(const CheckContext& c, Checks& checks) {
  std::string channels, says;
  double longest = 0;
  for (std::size_t k = 0; k < reading_count; ++k) {
    const double period = is_used(k) && c.heard({k}) ? c.held_s[k] : 0;
    if (period == 0) continue;
    add_to(channels, reading_names[k]);
    add_to(says, fmt::format("{} every {:.3g} s", reading_names[k], period));
    longest = std::max(longest, period);
  }
  if (!channels.empty())
    add_check(checks, "held_samples", channels, {longest}, false,
              "Rows come every {:.3g} s and repeat readings; new readings come less often: {}.", c.period_s(),
              says);
}

}  // namespace

std::array<double, reading_count> held_times(std::span<const telemetry::Recording> missions, double row_s) {
  std::array<double, reading_count> held{};
  for (std::size_t k = 0; k < reading_count; ++k) {
    if (!is_used(k)) continue;
    std::vector<double> time_s, value;
    double begin_s = 0;  // of a mission, right after the one before
    for (const telemetry::Recording& mission : missions) {
      for (const signals::Sample& s : mission.samples) {
        time_s.push_back(begin_s + 1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us));
        value.push_back(*signals::numbers_of(s)[k]);
      }
      if (!time_s.empty()) begin_s = time_s.back() + row_s;
    }
    const statistics::Updates updates = statistics::find_updates(time_s, value);
    if (!updates.held) continue;
    // An import may insert rows before changes: they shorten the time between rows, not between readings.
    const double period = std::min(updates.period_s, time_s.back() / static_cast<double>(updates.at.size()));
    if (period >= least_held * row_s) held[k] = period;
  }
  return held;
}

// Steps of the wheels' speeds there and back by the period of a counter.
void check_leaps(const CheckContext& c, Checks& checks) {
  std::size_t leaps = 0;
  double least = std::numeric_limits<double>::infinity(), farthest = 0, greatest = 0;
  for (const Observation& o : c.seen) {
    leaps += o.leaps;
    least = std::min(least, o.least_leap_rad_s);
    farthest = std::max(farthest, o.farthest_leap_rad_s);
  }
  // A counter's readings lie within its period.
  for (const std::size_t k : {reading::wheel_velocity, reading::wheel_velocity + 1})
    greatest = std::max({greatest, c.tally(k).high(), -c.tally(k).low()});
  if (leaps < fewest_leaps || least <= alike_leaps * farthest || greatest >= (2 - alike_leaps) * farthest ||
      !c.heard({reading::wheel_velocity, reading::wheel_velocity + 1}))
    return;
  add_check(checks, "wheel_velocity_leaps", "wheel_velocity", {static_cast<double>(leaps)}, true,
            "wheel_velocity steps {} times by up to {:.4g} rad/s from one sample to the next, {:.3g} times "
            "limits.speed_m_s, and stays: no robot accelerates like this; a counter that overflows? An "
            "import corrects it with wraps_at.",
            leaps, farthest, farthest * c.robot.kinematics.wheel_radius_m / c.robot.limits.speed_m_s);
}

void check_spikes(const CheckContext& c, Checks& checks) {
  for (std::size_t k = 0; k < reading_count; ++k) {
    std::size_t spikes = 0;
    for (const Observation& o : c.seen) spikes += o.spikes[k];
    if (spikes < fewest_spikes || !c.heard({k})) continue;
    add_check(checks, "thrown_readings", reading_names[k], {static_cast<double>(spikes)}, false,
              "{} jumps away and back within one row {} times, as no {} can: lost or mixed messages.",
              reading_names[k], spikes, k == reading::battery_voltage ? "battery" : "wheel");
  }
}

void check_readings(const CheckContext& c, Checks& checks) {
  std::string missing;
  double most = 0;
  for (std::size_t k = 0; k < reading_count; ++k) {
    if (c.tally(k).known() == 0 && k > reading::wheel_velocity + 1) continue;
    const double share = lost_rows(c, k);
    if (share <= lost_share) continue;
    add_to(missing, reading_names[k]);
    most = std::max(most, share);
  }
  if (!missing.empty())
    add_check(checks, "mostly_missing", missing, {most}, false,
              "{} missing in up to {:.0f} % of the rows, for long intervals.", missing, 100 * most);
  check_held(c, checks);
}

std::vector<Check> check_ranges(const telemetry::RecordingSet& recordings) {
  std::vector<Check> checks;
  for (const auto& [field, beyond] : recordings.beyond_range) {
    const double samples = static_cast<double>(beyond.samples);
    const double share = samples / (samples + static_cast<double>(recordings.samples));
    if (share < biased_share) continue;
    add_check(checks, "implausible_readings", field, {share}, true,
              "{} of {} samples are left out for an impossible {}, up to {:.4g}{}: the remaining "
              "ones are biased.",
              beyond.samples, beyond.samples + recordings.samples, field, beyond.farthest,
              telemetry::in_other_unit(field, beyond.farthest));
  }
  return checks;
}

}  // namespace joulecast::plausibility
