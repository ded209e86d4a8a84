#include "plausibility/tally.h"

#include <algorithm>
#include <cmath>

#include "base/median.h"

namespace joulecast::plausibility {
namespace {

constexpr double alike = 0.2;       // neighbours that differ by less are the same level
constexpr double thrown = 0.8;      // a value this far from the level of both its neighbours is a spike
constexpr std::int64_t corner = 8;  // clock steps this many times shorter than the one before are excluded
constexpr double well_off = 0.2;    // of the largest value; lower levels are not searched for spikes

constexpr std::size_t fewest_changes = 8;  // fewer are not sufficient
// Repetitions longer than this many times the upper quartile are a steady state, not held readings.
constexpr double steady = 4;
// Share of the time in repetitions that must be in repetitions of a whole number of periods, each to within a
// quarter of a period. Where a coarse converter repeats values by chance, lengths are geometric and the share
// is less than half.
constexpr double regular_part = 0.7, off_period = 0.25;

// The first length, in order, at which the cumulative share reaches `part`. `part_of`: weight of an entry.
std::size_t length_at(std::span<const Repetitions> lengths, double part, const auto& part_of) {
  double total = 0, sum = 0;
  for (const Repetitions& r : lengths) total += part_of(r);
  for (const Repetitions& r : lengths) {
    sum += part_of(r);
    if (sum >= part * total) return r.rows;
  }
  return 1;
}

std::size_t octave(double value) {
  return static_cast<std::size_t>(std::clamp(std::ilogb(value) + 32, 0, 63));
}

void count_gaps(signals::GapDetector& detector, bool ended, ClockTally::Gaps& gaps) {
  while (const auto decided = detector.next(ended)) {
    if (decided->step != signals::Step::gap) continue;
    ++gaps.count;
    gaps.seconds += decided->step_s;
  }
}

}  // namespace

std::size_t rows_held(std::span<const Repetitions> lengths) {
  const auto count_of = [](const Repetitions& r) { return static_cast<double>(r.count); };
  const auto time_of = [](const Repetitions& r) { return static_cast<double>(r.count * r.rows); };
  std::size_t count = 0;
  for (const Repetitions& r : lengths) count += r.count;
  if (count < fewest_changes) return 1;
  const double longest = steady * static_cast<double>(length_at(lengths, 0.75, count_of));
  while (static_cast<double>(lengths.back().rows) > longest) lengths = lengths.first(lengths.size() - 1);
  const std::size_t held = length_at(lengths, 0.5, time_of);
  if (held < 2) return 1;
  const double period = static_cast<double>(held);
  double total = 0, regular = 0;
  for (const Repetitions& r : lengths) {
    const double rows = static_cast<double>(r.rows), times = std::max(1.0, std::round(rows / period));
    total += time_of(r);
    if (std::fabs(rows - times * period) <= off_period * period + 0.5) regular += time_of(r);
  }
  return regular >= regular_part * total ? held : 1;
}

bool is_spike(double before, double value, double after) {
  const double level = 0.5 * (before + after);
  return before * after > 0 && std::fabs(before - after) < alike * std::fabs(level) &&
         std::fabs(value - level) > thrown * std::fabs(level);
}

void ValueTally::note_level(double value) {
  if (fine_) return;
  const auto at = std::ranges::lower_bound(levels_, value);
  if (at != levels_.end() && *at == value) return;
  if (levels_.size() == most_levels) {
    fine_ = true;
    levels_.clear();
    levels_.shrink_to_fit();
    return;
  }
  levels_.insert(at, value);
}

void ValueTally::note_run() {
  if (changed_) ++runs_[std::min(run_, longest_run)];
  changed_ = true;
  run_ = 0;
}

void ValueTally::add(double value) {
  ++rows_;
  if (!std::isfinite(value)) {
    ++missing_;
    return;
  }
  if (missing_ > slowest) lost_ += missing_;
  missing_ = 0;
  if (known_ == 0) {
    origin_ = value;
    lowest_ = highest_ = {value, 0, 0};
  } else if (value != last_[0]) {
    note_run();
  }
  if (known_ >= 2 && is_spike(last_[1], last_[0], value)) ++spikes_[octave(0.5 * (last_[1] + value))];
  const bool stays = known_ > 0 && value == last_[0];
  for (Extreme* extreme : {&lowest_, &highest_}) {
    const bool beyond = extreme == &lowest_ ? value < extreme->value : value > extreme->value;
    if (beyond) *extreme = {value, 0, 0};
    if (value != extreme->value) continue;
    ++extreme->rows;
    if (!stays || extreme->runs == 0) ++extreme->runs;
  }
  last_ = {value, last_[0]};
  ++known_;
  ++run_;
  if (value == 0) ++zeros_;
  sum_ += value - origin_;
  square_ += (value - origin_) * (value - origin_);
  note_level(value);
}

void ValueTally::append(const ValueTally& other) {
  const std::size_t rows = rows_ + other.rows_, lost = this->lost() + other.lost();
  if (known_ == 0)
    *this = other;
  else if (other.known_ > 0)
    join(other);
  rows_ = rows;
  lost_ = lost;
  missing_ = 0;
}

std::size_t ValueTally::lost() const {
  return lost_ + (missing_ > slowest ? missing_ : 0);
}

void ValueTally::join(const ValueTally& other) {
  const double shift = other.origin_ - origin_, count = static_cast<double>(other.known_);
  square_ += other.square_ + 2 * shift * other.sum_ + count * shift * shift;
  sum_ += other.sum_ + count * shift;
  known_ += other.known_;
  zeros_ += other.zeros_;
  for (std::size_t k = 0; k < spikes_.size(); ++k) spikes_[k] += other.spikes_[k];
  const auto widen = [](Extreme& mine, const Extreme& theirs, bool beyond) {
    if (beyond)
      mine = theirs;
    else if (mine.value == theirs.value)
      mine.rows += theirs.rows, mine.runs += theirs.runs;
  };
  widen(lowest_, other.lowest_, other.lowest_.value < lowest_.value);
  widen(highest_, other.highest_, other.highest_.value > highest_.value);
  for (std::size_t k = 0; k < runs_.size(); ++k) runs_[k] += other.runs_[k];
  fine_ = fine_ || other.fine_;
  if (fine_) levels_.clear();
  for (const double level : other.levels_) note_level(level);
}

double ValueTally::mean() const {
  return origin_ + sum_ / static_cast<double>(known_);
}

double ValueTally::deviation() const {
  const double n = static_cast<double>(known_), mean = sum_ / n;
  return std::sqrt(std::max(square_ / n - mean * mean, 0.0));
}

std::size_t ValueTally::spikes() const {
  const double least = well_off * std::max(std::fabs(low()), std::fabs(high()));
  std::size_t count = 0;
  for (std::size_t k = octave(least) + 1; k < spikes_.size(); ++k) count += spikes_[k];
  return count;
}

ValueTally::Extreme ValueTally::extreme() const {
  return highest_.rows >= lowest_.rows ? highest_ : lowest_;
}

std::size_t ValueTally::held_rows() const {
  std::vector<Repetitions> lengths;
  for (std::size_t k = 0; k < runs_.size(); ++k) {
    if (runs_[k] > 0) lengths.push_back({k, runs_[k]});
  }
  return rows_held(lengths);
}

double ValueTally::quantum() const {
  if (fine_ || levels_.size() < 2) return 0;
  std::vector<double> steps;
  for (std::size_t k = 1; k < levels_.size(); ++k) steps.push_back(levels_[k] - levels_[k - 1]);
  return upper_median(std::move(steps));
}

void ClockTally::add(std::int64_t utime_us, std::int64_t sequence) {
  if (rows_ == 0 || utime_us > before_us_) detector_.add(utime_us, sequence);
  count_gaps(detector_, false, gaps_);
  if (rows_ == 0) {
    first_us_ = last_us_ = utime_us;
    low_sequence_ = high_sequence_ = sequence;
  } else {
    const std::int64_t step = utime_us - before_us_;
    if (step == 0) ++repeated_;
    if (step < 0) ++backward_;
    if (step > 0 && step >= step_us_ / corner) {
      const double place = 16 * std::log10(static_cast<double>(step));
      Class& c = steps_[std::min(static_cast<std::size_t>(place), classes - 1)];
      ++c.count;
      c.seconds += 1e-6 * static_cast<double>(step);
    }
    step_us_ = step;
    if (sequence <= sequence_) ++disordered_;
  }
  ++rows_;
  first_us_ = std::min(first_us_, utime_us);
  last_us_ = std::max(last_us_, utime_us);
  low_sequence_ = std::min(low_sequence_, sequence);
  high_sequence_ = std::max(high_sequence_, sequence);
  before_us_ = utime_us;
  sequence_ = sequence;
}

double ClockTally::period_s() const {
  std::size_t total = 0, below = 0;
  for (const Class& c : steps_) total += c.count;
  for (const Class& c : steps_) {
    below += c.count;
    if (c.count > 0 && 2 * below >= total) return c.seconds / static_cast<double>(c.count);
  }
  return 0;
}

ClockTally::Gaps ClockTally::gaps() const {
  Gaps gaps = gaps_;
  signals::GapDetector rest = detector_;
  count_gaps(rest, true, gaps);
  return gaps;
}

}  // namespace joulecast::plausibility
