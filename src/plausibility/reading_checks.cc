#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "plausibility/evaluation.h"

namespace joulecast::plausibility {
namespace {

// Readings that are used in equations.
constexpr std::size_t used = reading::battery_current + 1;
constexpr std::size_t fewest_spikes = 3;
constexpr double least_held = 1.5;  // periods of rows; below, a reading is new in each row
constexpr double coarse = 1;        // step over the standard deviation; rounding adds a third of it as noise
constexpr double clipped_share = 0.01;
constexpr std::size_t fewest_clips = 3, longest_plateau = 3;  // runs; usual repetitions of a value
constexpr double lost_share = 0.5;
constexpr double biased_share = 0.1;  // of the samples; beyond, the remaining samples are biased

// Used readings and the yaw rate.
template <class Do>
void each_reading(const CheckContext& c, Do look) {
  for (std::size_t k = 0; k < reading_count; ++k) {
    if ((k >= used && k != reading::yaw_rate) || !c.heard({k})) continue;
    if (const ValueTally& t = c.tally(k); t.known() > 0) look(k, t);
  }
}

void add_to(std::string& list, std::string_view text) {
  if (!list.empty()) list += ", ";
  list += text;
}

// Mean time between rows, except for gaps. Less than the period where an import adds rows before changes of
// held readings.
double row_s(const CheckContext& c) {
  double length_s = 0, steps = 0;
  for (const Observation& o : c.seen) {
    length_s += o.clock.length_s();
    steps += static_cast<double>(o.clock.rows()) - 1;
  }
  return steps > 0 ? std::min(c.period_s(), length_s / steps) : c.period_s();
}

void check_held(const CheckContext& c, Checks& checks) {
  std::string channels, says;
  double longest = 0;
  const double between_rows_s = row_s(c);
  each_reading(c, [&](std::size_t k, const ValueTally& t) {
    if (t.held_rows() < 2) return;
    const double period = static_cast<double>(t.held_rows()) * between_rows_s;
    if (period < least_held * c.period_s()) return;
    add_to(channels, reading_names[k]);
    add_to(says, fmt::format("{} every {:.3g} s", reading_names[k], period));
    longest = std::max(longest, period);
  });
  if (channels.empty()) return;
  add_check(checks, "held_samples", channels, longest, false,
            "Readings are repeated in rows that come every {:.3g} s: {} is new; what lies between is no "
            "measurement.",
            c.period_s(), says);
}

void check_coarse(const CheckContext& c, Checks& checks) {
  each_reading(c, [&](std::size_t k, const ValueTally& t) {
    if (t.constant() || t.quantum() < coarse * t.deviation()) return;
    add_check(checks, "coarse_channel", reading_names[k], t.quantum(), false,
              "{} comes in steps of {:.3g}, and moves by only {:.2g} of a step (standard deviation).",
              reading_names[k], t.quantum(), t.deviation() / t.quantum());
  });
}

void check_clipped(const CheckContext& c, Checks& checks) {
  each_reading(c, [&](std::size_t k, const ValueTally& t) {
    if (k < reading::motor_current || k == reading::battery_voltage || t.levels() <= ValueTally::most_levels)
      return;
    const ValueTally::Extreme e = t.extreme();
    const double share = static_cast<double>(e.rows) / static_cast<double>(t.known());
    if (e.value == 0 || share < clipped_share || e.runs < fewest_clips ||
        e.rows < longest_plateau * t.held_rows() * e.runs) {
      return;
    }
    add_check(
        checks, "clipped_channel", reading_names[k], e.value, false,
        "{} reads exactly {:.4g} in {:.1f} % of the rows and never beyond: clipped by the sensor, or held "
        "there by the driver.",
        reading_names[k], e.value, 100 * share);
  });
}

void check_thrown(const CheckContext& c, Checks& checks) {
  each_reading(c, [&](std::size_t k, const ValueTally& t) {
    const bool steady = k < reading::motor_voltage || k == reading::battery_voltage;
    if (!steady || t.spikes() < fewest_spikes) return;
    add_check(checks, "thrown_readings", reading_names[k], static_cast<double>(t.spikes()), false,
              "{} jumps away and back within one row {} times, as no {} can: lost or mixed messages.",
              reading_names[k], t.spikes(), k == reading::battery_voltage ? "battery" : "wheel");
  });
}

void check_missing(const CheckContext& c, Checks& checks) {
  std::string channels;
  double most = 0;
  for (std::size_t k = 0; k < reading_count; ++k) {
    const ValueTally& t = c.tally(k);
    if (t.known() == 0 && k != reading::wheel_velocity && k != reading::wheel_velocity + 1) continue;
    const double share =
        static_cast<double>(t.lost()) / static_cast<double>(std::max<std::size_t>(t.rows(), 1));
    if (share <= lost_share) continue;
    add_to(channels, reading_names[k]);
    most = std::max(most, share);
  }
  if (channels.empty()) return;
  add_check(checks, "mostly_missing", channels, most, false,
            "{} missing in up to {:.0f} % of the rows, for long intervals.", channels, 100 * most);
}

}  // namespace

void check_readings(const CheckContext& c, Checks& checks) {
  check_missing(c, checks);
  check_thrown(c, checks);
  check_held(c, checks);
  check_coarse(c, checks);
  check_clipped(c, checks);
}

std::vector<Check> check_ranges(const telemetry::RecordingSet& recordings) {
  std::vector<Check> checks;
  for (const auto& [field, beyond] : recordings.beyond_range) {
    const double samples = static_cast<double>(beyond.samples);
    const double share = samples / (samples + static_cast<double>(recordings.samples));
    if (share < biased_share) continue;
    add_check(checks, "implausible_readings", field, share, true,
              "{} of {} samples are left out for a {} that no robot reads, as far as {:.4g}{}: the remaining "
              "samples are a biased choice.",
              beyond.samples, beyond.samples + recordings.samples, field, beyond.farthest,
              telemetry::in_other_unit(field, beyond.farthest));
  }
  return checks;
}

}  // namespace joulecast::plausibility
