#include "energy/back_test.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "telemetry/payload.h"

namespace joulecast::energy {
namespace {

// Measured energy and what a model misses of it, over one span of a run.
struct Span {
  double measured_j = 0;
  double missed_j = 0;  // modelled - measured

  Span& operator+=(const Span& b) {
    measured_j += b.measured_j;
    missed_j += b.missed_j;
    return *this;
  }
};

// Spans shorter than this are not told apart: sampling noise would fill the power gap.
constexpr double bin_s = 0.5;

struct Replay {
  std::vector<Span> bins;  // of bin_s, by time since the run's first sample
  double battery_s = 0, motors_s = 0;
};

// The meter over a run; what it adds to its accounts from sample to sample goes into the bins.
Result<Replay> replay(const dynamics::DriveModel& model, const DriveRun& run, bool at_battery,
                      const BackTestSettings& settings) {
  Replay result;
  Accounts last;
  const Meter* source = nullptr;
  const auto take = [&](const MeterPoint& point) {
    const Accounts& now = source->accounts();
    const bool counts =
        at_battery ? now.measured_s > last.measured_s : now.motor_measured_s > last.motor_measured_s;
    if (counts) {
      const auto k = static_cast<std::size_t>(std::max(0.0, point.t_s - 0.5 * point.interval_s) / bin_s);
      if (k >= result.bins.size()) result.bins.resize(k + 1);
      Span part;
      if (at_battery) {
        part.measured_j = now.measured_j - last.measured_j;
        part.missed_j = -(now.ledger[Term::unexplained] - last.ledger[Term::unexplained]);
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
  telemetry::MissionPayload payload(run.payload_kg);
  for (telemetry::Sample sample : run.samples) {
    sample.payload_kg = payload.take(sample.payload_kg);
    if (Result<void> added = meter.add(sample); !added) return tl::unexpected(std::move(added.error()));
  }
  if (Result<void> flushed = meter.flush(); !flushed) return tl::unexpected(std::move(flushed.error()));
  result.battery_s = meter.accounts().measured_s;
  result.motors_s = meter.accounts().motor_measured_s;
  return result;
}

std::vector<Span> blocks_of(const std::vector<Span>& bins, double block_s) {
  const auto per_block = static_cast<std::size_t>(std::max(1.0, std::round(block_s / bin_s)));
  std::vector<Span> blocks((bins.size() + per_block - 1) / per_block);
  for (std::size_t k = 0; k < bins.size(); ++k) blocks[k / per_block] += bins[k];
  return blocks;
}

// One run by both models: the blocks are drawn together, for what they measured is the same.
struct Pair {
  std::vector<Span> before, after;
};

Span drawn(const std::vector<Span>& blocks, std::span<const std::size_t> picks) {
  Span sum;
  for (const std::size_t k : picks) sum += blocks[k];
  return sum;
}

std::array<double, 2> middle_95(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t tail = values.size() / 40;
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

double improvement_of(std::span<const Pair> pairs, Random& random, std::vector<std::size_t>& picks) {
  std::uniform_int_distribution<std::size_t> any(0, pairs.size() - 1);
  double before = 0, after = 0, measured = 0;
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    const Pair& pair = pairs[any(random)];
    pick_blocks(pair.before.size(), random, picks);
    const Span b = drawn(pair.before, picks), a = drawn(pair.after, picks);
    before += std::fabs(b.missed_j);
    after += std::fabs(a.missed_j);
    measured += std::fabs(b.measured_j);
  }
  return measured > 0 ? (before - after) / measured : 0;
}

void fill(ModelError& error, const std::vector<Span>& bins, double& gap_j, double& size_j) {
  Span sum;
  double absolute = 0, size = 0;
  for (const Span& bin : bins) {
    sum += bin;
    absolute += std::fabs(bin.missed_j);
    size += std::fabs(bin.measured_j);
  }
  error.energy_j = sum.measured_j + sum.missed_j;
  error.relative = sum.missed_j / sum.measured_j;
  error.power_absolute_relative = absolute / size;
  gap_j += absolute;
  size_j = size;
}

}  // namespace

bool BackTest::improves() const {
  return !runs.empty() && improvement_interval[0] > 0 && power_gap_after <= power_gap_before;
}

Result<BackTest> back_test(std::span<const DriveRun> runs, const robot::RobotModel& before,
                           const robot::RobotModel& after, const BackTestSettings& settings) {
  const Result<dynamics::DriveModel> first = dynamics::drive_model(before);
  if (!first) return tl::unexpected(first.error());
  const Result<dynamics::DriveModel> second = dynamics::drive_model(after);
  if (!second) return tl::unexpected(second.error());

  BackTest result;
  result.improvement_interval = {ModelError::unknown, ModelError::unknown};
  std::vector<Pair> pairs;
  Random random(20240229);
  double before_j = 0, after_j = 0, measured_j = 0, gap_before_j = 0, gap_after_j = 0, size_j = 0;
  for (const DriveRun& run : runs) {
    if (settings.go_on && !settings.go_on()) return fail(Fault::conflict, "", "back-test cancelled");
    // The battery's accounts where it was measured for most of the run, else the motors'.
    RunComparison row;
    row.name = run.name;
    Result<Replay> a = replay(*first, run, true, settings);
    if (a && a->battery_s < settings.least_duration_s) {
      row.at_battery = false;
      a = replay(*first, run, false, settings);
    }
    if (!a) return tl::unexpected(std::move(a.error()));
    row.duration_s = row.at_battery ? a->battery_s : a->motors_s;
    if (row.duration_s < settings.least_duration_s) continue;
    const Result<Replay> b = replay(*second, run, row.at_battery, settings);
    if (!b) return tl::unexpected(b.error());
    for (const Span& bin : a->bins) row.measured_j += bin.measured_j;
    if (row.measured_j < settings.least_energy_j) continue;
    double run_size_j = 0;
    fill(row.before, a->bins, gap_before_j, run_size_j);
    fill(row.after, b->bins, gap_after_j, run_size_j);
    size_j += run_size_j;
    before_j += std::fabs(row.before.energy_j - row.measured_j);
    after_j += std::fabs(row.after.energy_j - row.measured_j);
    measured_j += row.measured_j;
    pairs.push_back({blocks_of(a->bins, settings.block_s), blocks_of(b->bins, settings.block_s)});
    run_intervals(pairs.back(), settings.draws, random, row);
    result.runs.push_back(std::move(row));
  }
  if (pairs.empty()) return result;
  result.error_before = before_j / measured_j;
  result.error_after = after_j / measured_j;
  result.power_gap_before = gap_before_j / size_j;
  result.power_gap_after = gap_after_j / size_j;
  std::vector<double> improvements;
  std::vector<std::size_t> picks;
  for (int draw = 0; draw < settings.draws; ++draw)
    improvements.push_back(improvement_of(pairs, random, picks));
  result.improvement_interval = middle_95(std::move(improvements));
  return result;
}

}  // namespace joulecast::energy
