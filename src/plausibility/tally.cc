#include "plausibility/tally.h"

#include <algorithm>
#include <cmath>

namespace joulecast::plausibility {
namespace {

constexpr double alike = 0.2;       // neighbours that differ by less are the same level
constexpr double thrown = 0.8;      // a value this far from the level of both its neighbours is a spike
constexpr std::int64_t corner = 8;  // clock steps this many times shorter than the one before are excluded

void count_gaps(signals::GapDetector& detector, bool ended, ClockTally::Steps& gaps) {
  while (const auto decided = detector.next(ended)) {
    if (decided->step != signals::Step::gap) continue;
    ++gaps.count;
    gaps.seconds += decided->step_s;
  }
}

}  // namespace

bool is_spike(double before, double value, double after) {
  const double level = 0.5 * (before + after);
  return before * after > 0 && std::fabs(before - after) < alike * std::fabs(level) &&
         std::fabs(value - level) > thrown * std::fabs(level);
}

void ValueTally::add(double value) {
  if (!std::isfinite(value)) return;
  if (known_++ == 0) origin_ = low_ = high_ = value;
  low_ = std::min(low_, value);
  high_ = std::max(high_, value);
  sum_ += value - origin_;
  square_ += (value - origin_) * (value - origin_);
}

void ValueTally::append(const ValueTally& other) {
  if (other.known_ == 0) return;
  if (known_ == 0) return void(*this = other);
  const double shift = other.origin_ - origin_, count = static_cast<double>(other.known_);
  square_ += other.square_ + 2 * shift * other.sum_ + count * shift * shift;
  sum_ += other.sum_ + count * shift;
  known_ += other.known_;
  low_ = std::min(low_, other.low_);
  high_ = std::max(high_, other.high_);
}

double ValueTally::mean() const {
  return origin_ + sum_ / static_cast<double>(known_);
}

double ValueTally::deviation() const {
  const double n = static_cast<double>(known_), mean = sum_ / n;
  return std::sqrt(std::max(square_ / n - mean * mean, 0.0));
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
    if (step > 0 && step_us_ >= 0 && step >= step_us_ / corner) {
      ++steps_.count;
      steps_.seconds += 1e-6 * static_cast<double>(step);
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
  Steps usual = steps_;
  // In another unit each step may be a gap.
  if (const Steps apart = gaps(); 2 * apart.count < usual.count) {
    usual.count -= apart.count;
    usual.seconds -= apart.seconds;
  }
  return usual.count > 0 ? usual.seconds / static_cast<double>(usual.count) : 0;
}

ClockTally::Steps ClockTally::gaps() const {
  Steps gaps = gaps_;
  signals::GapDetector rest = detector_;
  count_gaps(rest, true, gaps);
  return gaps;
}

}  // namespace joulecast::plausibility
