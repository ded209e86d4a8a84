#include "energy/back_test.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "base/try.h"

namespace joulecast::energy {
namespace {

// Measured energy and the model's error over one span of a run.
struct Span {
  double measured_j = 0;
  double missed_j = 0;  // modelled - measured
  double gap_j = 0;     // |missed_j| and |measured_j| of the bins within, for the power gap
  double size_j = 0;
  double missed_v = 0, size_v = 0;  // |voltage| from the bin before, missed and measured

  Span& operator+=(const Span& b) {
    measured_j += b.measured_j;
    missed_j += b.missed_j;
    gap_j += b.gap_j;
    size_j += b.size_j;
    missed_v += b.missed_v;
    size_v += b.size_v;
    return *this;
  }
};

// Spans shorter than this are not distinguished: sampling noise would fill the power gap. Halved and doubled:
// the same proposals (calibrate.md).
constexpr double bin_s = 0.5;

struct Replay {
  std::vector<Span> bins;  // of bin_s, by time since the run's first sample
  double battery_s = 0, motors_s = 0;
};

// Replays a run through the meter; each sample's increase of the accounts goes into the bins.
Result<Replay> replay(const dynamics::DriveModel& model, const DriveRun& run, bool at_battery,
                      const BackTestSettings& settings) {
  Replay result;
  signals::Accounts last;
  const Meter* source = nullptr;
  const auto take = [&](const MeterPoint& point) {
    const signals::Accounts& now = source->accounts();
    const bool counts =
        at_battery ? now.measured_s > last.measured_s : now.motor_measured_s > last.motor_measured_s;
    if (counts) {
      const auto k = static_cast<std::size_t>(std::max(0.0, point.t_s - 0.5 * point.interval_s) / bin_s);
      if (k >= result.bins.size()) result.bins.resize(k + 1);
      Span part;
      if (at_battery) {
        part.measured_j = now.measured_j - last.measured_j;
        part.missed_j = -(now.ledger[signals::Term::unexplained] - last.ledger[signals::Term::unexplained]);
      } else {
        for (std::size_t s : {0u, 1u}) {
          const double measured = now.measured_motor_j[s] - last.measured_motor_j[s];
          part.measured_j += measured;
          part.missed_j += now.modelled_motor_j[s] - last.modelled_motor_j[s] - measured;
        }
      }
      result.bins[k] += part;
    }
    last = now;
  };
  MeterSettings metering = settings.meter;
  metering.half_window_s = std::max(metering.half_window_s, half_window_for({&run, 1}));
  Meter meter(model, metering, take);
  source = &meter;
  TRY(meter_run(meter, run, metering.gap_bridge_s));
  for (Span& bin : result.bins) {
    bin.gap_j = std::fabs(bin.missed_j);
    bin.size_j = std::fabs(bin.measured_j);
  }
  result.battery_s = meter.accounts().measured_s;
  result.motors_s = meter.accounts().motor_measured_s;
  return result;
}

// The battery's voltage from bin to bin: open-circuit voltage and slow sag do not change in that time.
void add_voltage(const DriveRun& run, double resistance_ohm, std::vector<Span>& bins) {
  double volts = 0, amperes = 0, readings = 0;
  std::optional<std::array<double, 2>> before;
  std::size_t bin = 0;
  for (std::size_t k = 0; k <= run.samples.size(); ++k) {
    const std::size_t now =
        k == run.samples.size()
            ? bins.size()
            : static_cast<std::size_t>(
                  1e-6 * static_cast<double>(run.samples[k].utime_us - run.samples[0].utime_us) / bin_s);
    if (now != bin) {
      std::optional<std::array<double, 2>> mean;
      if (readings > 0) mean = {volts / readings, amperes / readings};
      if (mean && before && bin < bins.size()) {
        const double change_v = (*mean)[0] - (*before)[0], change_a = (*mean)[1] - (*before)[1];
        bins[bin].missed_v = std::fabs(change_v + resistance_ohm * change_a);
        bins[bin].size_v = std::fabs(change_v);
      }
      before = now == bin + 1 ? mean : std::nullopt;
      volts = amperes = readings = 0;
      bin = now;
    }
    if (k == run.samples.size()) break;
    const signals::Sample& s = run.samples[k];
    if (!std::isfinite(s.battery_voltage_v + s.battery_current_a)) continue;
    volts += s.battery_voltage_v, amperes += s.battery_current_a, ++readings;
  }
}

std::vector<Span> blocks_of(const std::vector<Span>& bins, double block_s) {
  const auto per_block = static_cast<std::size_t>(std::max(1.0, std::round(block_s / bin_s)));
  std::vector<Span> blocks((bins.size() + per_block - 1) / per_block);
  for (std::size_t k = 0; k < bins.size(); ++k) blocks[k / per_block] += bins[k];
  return blocks;
}

// One run by both models. Their blocks are drawn together: both have the same measurements.
struct Pair {
  std::vector<Span> before, after;
  bool differ = false;  // the models, on this run, by more than rounding
};

// Share of the measured energy, or of the changes of voltage. Runs on which two models agree, such as runs
// without payload where an effect of payload was found, do not show which model is better; drawn with the
// others, they would only dilute them (AgreeingRunsDoNotDilute). Halved and doubled: the same proposals.
constexpr double least_difference = 1e-3;

bool models_differ(const std::vector<Span>& before, const std::vector<Span>& after) {
  double difference_j = 0, size_j = 0, difference_v = 0, size_v = 0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    difference_j += std::fabs(after[k].missed_j - before[k].missed_j);
    size_j += before[k].size_j;
    difference_v += std::fabs(after[k].missed_v - before[k].missed_v);
    size_v += before[k].size_v;
  }
  return difference_j > least_difference * size_j || difference_v > least_difference * size_v;
}

Span whole(const std::vector<Span>& bins) {
  Span sum;
  for (const Span& bin : bins) sum += bin;
  return sum;
}

Span drawn(const std::vector<Span>& blocks, std::span<const std::size_t> picks) {
  Span sum;
  for (const std::size_t k : picks) sum += blocks[k];
  return sum;
}

// `comparisons`: see BackTestSettings.
std::array<double, 2> middle_95(std::vector<double> values, std::size_t comparisons = 1) {
  std::ranges::sort(values);
  const std::size_t tail = values.size() / (40 * comparisons);
  return {values[tail], values[values.size() - 1 - tail]};
}

using Random = std::mt19937_64;

void pick_blocks(std::size_t count, Random& random, std::vector<std::size_t>& picks) {
  std::uniform_int_distribution<std::size_t> any(0, count - 1);
  picks.resize(count);
  for (std::size_t& k : picks) k = any(random);
}

// The 95 % interval of each model's relative error on one run.
void run_intervals(const Pair& pair, int draws, Random& random, RunComparison& run) {
  std::vector<double> before, after;
  std::vector<std::size_t> picks;
  for (int draw = 0; draw < draws; ++draw) {
    pick_blocks(pair.before.size(), random, picks);
    const Span b = drawn(pair.before, picks), a = drawn(pair.after, picks);
    if (!(b.measured_j > 0)) continue;
    before.push_back(b.missed_j / b.measured_j);
    after.push_back(a.missed_j / a.measured_j);
  }
  if (before.size() < static_cast<std::size_t>(draws) / 2) return;
  run.before.interval = middle_95(std::move(before));
  run.after.interval = middle_95(std::move(after));
}

// How much energy error and power gap fall on runs drawn with replacement among those where the models
// differ; the others stay as they are.
struct Falls {
  double error = 0, power_gap = 0, voltage_gap = 0;
};

Falls drawn_falls(std::span<const Pair> pairs, std::span<const std::size_t> drawable, Random& random,
                  std::vector<std::size_t>& picks) {
  Falls sum;
  double measured_j = 0, size_j = 0, size_v = 0;
  const auto add = [&](const Span& before, const Span& after) {
    sum.error += std::fabs(before.missed_j) - std::fabs(after.missed_j);
    sum.power_gap += before.gap_j - after.gap_j;
    measured_j += std::fabs(before.measured_j);
    size_j += before.size_j;
    sum.voltage_gap += before.missed_v - after.missed_v;
    size_v += before.size_v;
  };
  for (const Pair& pair : pairs)
    if (!pair.differ) add(whole(pair.before), whole(pair.after));
  std::uniform_int_distribution<std::size_t> any(0, drawable.empty() ? 0 : drawable.size() - 1);
  for (std::size_t n = 0; n < drawable.size(); ++n) {
    const Pair& pair = pairs[drawable[any(random)]];
    pick_blocks(pair.before.size(), random, picks);
    add(drawn(pair.before, picks), drawn(pair.after, picks));
  }
  return {measured_j > 0 ? sum.error / measured_j : 0, size_j > 0 ? sum.power_gap / size_j : 0,
          size_v > 0 ? sum.voltage_gap / size_v : 0};
}

ModelError error_of(const Span& run) {
  ModelError error;
  error.energy_j = run.measured_j + run.missed_j;
  error.relative = run.missed_j / run.measured_j;
  error.power_absolute_relative = run.gap_j / run.size_j;
  return error;
}

}  // namespace

bool BackTest::improves() const {
  if (runs.empty() || power_gap_after > power_gap_before || voltage_gap_after > voltage_gap_before ||
      improvement_interval[1] < 0)
    return false;
  return improvement_interval[0] > 0 || power_gap_fall_interval[0] > 0 || voltage_gap_fall_interval[0] > 0;
}

Result<BackTest> back_test(std::span<const DriveRun> runs, const robot::RobotModel& before,
                           const robot::RobotModel& after, const BackTestSettings& settings) {
  TRY_ASSIGN(const dynamics::DriveModel first, dynamics::drive_model(before));
  TRY_ASSIGN(const dynamics::DriveModel second, dynamics::drive_model(after));

  BackTest result;
  result.improvement_interval = result.power_gap_fall_interval = {ModelError::unknown, ModelError::unknown};
  std::vector<Pair> pairs;
  Random random(20240229);
  std::array<Span, 2> totals;  // before and after, missed_j without sign
  for (const DriveRun& run : runs) {
    if (settings.go_on && !settings.go_on()) return fail(Fault::conflict, "", "back-test cancelled");
    // The battery's accounts where it was measured for most of the run, else the motors'.
    RunComparison row;
    row.name = run.name;
    Result<Replay> a = replay(first, run, true, settings);
    if (a && a->battery_s < settings.least_duration_s) {
      row.at_battery = false;
      a = replay(first, run, false, settings);
    }
    if (!a) return tl::unexpected(std::move(a.error()));
    row.duration_s = row.at_battery ? a->battery_s : a->motors_s;
    if (row.duration_s < settings.least_duration_s) continue;
    TRY_ASSIGN(Replay b, replay(second, run, row.at_battery, settings));
    add_voltage(run, before.battery.internal_resistance_ohm, a->bins);
    add_voltage(run, after.battery.internal_resistance_ohm, b.bins);
    std::array<Span, 2> sums{whole(a->bins), whole(b.bins)};
    row.measured_j = sums[0].measured_j;
    if (row.measured_j < settings.least_energy_j) continue;
    row.before = error_of(sums[0]);
    row.after = error_of(sums[1]);
    for (const std::size_t k : {0u, 1u}) {
      sums[k].missed_j = std::fabs(sums[k].missed_j);
      totals[k] += sums[k];
    }
    pairs.push_back({blocks_of(a->bins, settings.block_s), blocks_of(b.bins, settings.block_s),
                     models_differ(a->bins, b.bins)});
    run_intervals(pairs.back(), settings.draws, random, row);
    result.runs.push_back(std::move(row));
  }
  if (pairs.empty()) return result;
  const auto& [before_all, after_all] = totals;
  result.error_before = before_all.missed_j / before_all.measured_j;
  result.error_after = after_all.missed_j / before_all.measured_j;
  result.power_gap_before = before_all.gap_j / before_all.size_j;
  result.power_gap_after = after_all.gap_j / before_all.size_j;
  const double size_v = before_all.size_v;
  if (size_v > 0) {
    result.voltage_gap_before = before_all.missed_v / size_v;
    result.voltage_gap_after = after_all.missed_v / size_v;
  }
  std::vector<std::size_t> drawable;
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (pairs[k].differ) drawable.push_back(k);
  std::vector<double> improvements, falls, voltage_falls;
  std::vector<std::size_t> picks;
  const std::size_t draws = static_cast<std::size_t>(settings.draws) * settings.comparisons;
  for (std::size_t draw = 0; draw < draws; ++draw) {
    const Falls fall = drawn_falls(pairs, drawable, random, picks);
    improvements.push_back(fall.error);
    falls.push_back(fall.power_gap);
    voltage_falls.push_back(fall.voltage_gap);
  }
  result.improvement_interval = middle_95(std::move(improvements), settings.comparisons);
  result.power_gap_fall_interval = middle_95(std::move(falls), settings.comparisons);
  if (size_v > 0)
    result.voltage_gap_fall_interval = middle_95(std::move(voltage_falls), settings.comparisons);
  return result;
}

}  // namespace joulecast::energy
