#include "signals/gaps.h"

#include <algorithm>
#include <cmath>

namespace joulecast::signals {
namespace {

double seconds(std::int64_t from_us, std::int64_t to_us) {
  return 1e-6 * static_cast<double>(to_us - from_us);
}

}  // namespace

double longest_bridged_s(double period_s, double bound_s) {
  return std::min(bound_s, std::max(always_bridged_s, bridged_periods * period_s));
}

double HeldReading::take(std::int64_t utime_us, double value) {
  const double since_s = seconds(last_utime_us_, utime_us);
  if (!std::isfinite(value)) return since_s >= 0 && since_s <= longest_bridged_s(period_s_) ? last_ : value;
  if (std::isfinite(last_) && since_s > 0) period_s_ = since_s;
  last_utime_us_ = utime_us;
  return last_ = value;
}

std::vector<Step> steps_of(std::span<const Sample> samples, double bound_s) {
  std::vector<Step> steps;
  steps.reserve(samples.size());
  GapDetector detector(bound_s);
  for (const Sample& sample : samples) {
    detector.add(sample.utime_us, sample.sequence);
    while (const auto decided = detector.next()) steps.push_back(decided->step);
  }
  while (const auto decided = detector.next(true)) steps.push_back(decided->step);
  return steps;
}

double GapDetector::period_s(std::span<const Mark> marks) {
  const std::size_t steps = marks.size() - 1;
  std::size_t whole = 0;  // that miss no number
  double whole_s = 0;
  for (std::size_t k = 1; k <= steps; ++k) {
    if (marks[k].sequence - marks[k - 1].sequence > 1) continue;
    whole_s += seconds(marks[k - 1].utime_us, marks[k].utime_us);
    ++whole;
  }
  if (2 * whole >= steps) return whole_s / static_cast<double>(whole);
  return seconds(marks.front().utime_us, marks.back().utime_us) / static_cast<double>(steps);
}

void GapDetector::add(std::int64_t utime_us, std::int64_t sequence) {
  if (next_ > 4 * steps_before) {
    const std::size_t done = next_ - steps_before - 1;
    marks_.erase(marks_.begin(), marks_.begin() + static_cast<std::ptrdiff_t>(done));
    next_ -= done;
  }
  marks_.push_back({utime_us, sequence});
}

std::optional<GapDetector::Decision> GapDetector::next(bool ended) {
  if (next_ == marks_.size()) return {};
  const std::optional<Decision> decided = decide(ended);
  if (decided) ++next_;
  return decided;
}

void GapDetector::reset() {
  marks_.clear();
  next_ = 0;
}

std::optional<GapDetector::Decision> GapDetector::decide(bool ended) const {
  if (next_ == 0) return Decision{};
  const std::span<const Mark> marks = marks_;
  const double step_s = seconds(marks[next_ - 1].utime_us, marks[next_].utime_us);
  const auto within = [&](double limit_s) {
    return Decision{step_s <= limit_s ? Step::bridged : Step::gap, step_s};
  };
  if (step_s > bound_s_ || step_s <= always_bridged_s) return within(bound_s_);
  const std::size_t before = std::min(next_ - 1, steps_before);
  const std::size_t after = std::min(marks.size() - 1 - next_, steps_after);
  double period = before > 0 ? period_s(marks.subspan(next_ - 1 - before, before + 1)) : 0;
  if (step_s <= longest_bridged_s(period, bound_s_)) return within(bound_s_);
  if (after < steps_after && !ended) return {};
  if (after > 0) period = std::max(period, period_s(marks.subspan(next_, after + 1)));
  return within(before + after > 0 ? longest_bridged_s(period, bound_s_) : bound_s_);
}

}  // namespace joulecast::signals
