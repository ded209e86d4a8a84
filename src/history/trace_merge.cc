#include "history/trace_merge.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

namespace joulecast::history {
namespace {

void keep_last(double& kept, double value) {
  if (!std::isnan(value)) kept = value;
}

// fmin and fmax pass over NaN.
void widen(Band& band, const Band& other) {
  band.min = std::fmin(band.min, other.min);
  band.max = std::fmax(band.max, other.max);
}

}  // namespace

void TraceMerger::Mean::add(double value, double with_weight) {
  if (std::isnan(value)) return;
  weight += with_weight;
  sum += with_weight * value;
}

double TraceMerger::Mean::value() const {
  return weight > 0 ? sum / weight : signals::unmeasured;
}

TraceMerger::TraceMerger(std::int64_t origin_utime_us, std::int64_t width_us)
    : origin_utime_us_(origin_utime_us) {
  assert(width_us > 0 && width_us % trace_bucket_us == 0);
  trace_.width_us = width_us;
}

void TraceMerger::begin(std::int64_t start_utime_us) {
  has_group_ = true;
  group_ = TraceBucket{};
  group_.start_utime_us = start_utime_us;
  measured_power_w_ = modelled_power_w_ = speed_m_s_ = x_m_ = y_m_ = Mean{};
}

void TraceMerger::end() {
  if (!has_group_) return;
  group_.measured_power_w.mean = measured_power_w_.value();
  group_.modelled_power_w.mean = modelled_power_w_.value();
  group_.speed_m_s.mean = speed_m_s_.value();
  group_.x_m = x_m_.value();
  group_.y_m = y_m_.value();
  trace_.buckets.push_back(group_);
  has_group_ = false;
}

void TraceMerger::add(const TraceBucket& bucket) {
  assert(bucket.start_utime_us >= origin_utime_us_);
  // Unsigned: two times may lie further apart than a signed difference holds.
  const auto offset =
      static_cast<std::uint64_t>(bucket.start_utime_us) - static_cast<std::uint64_t>(origin_utime_us_);
  const std::int64_t start =
      bucket.start_utime_us - static_cast<std::int64_t>(offset % static_cast<std::uint64_t>(trace_.width_us));
  if (!has_group_ || start != group_.start_utime_us) {
    end();
    begin(start);
  }
  // A bucket of a single sample covers no time; it must still be shown, with negligible weight in the mean.
  constexpr double least_weight_s = 1e-9;
  const double weight_s = std::fmax(bucket.covered_s, least_weight_s);
  group_.covered_s += std::isnan(bucket.covered_s) ? 0 : bucket.covered_s;
  widen(group_.measured_power_w, bucket.measured_power_w);
  widen(group_.modelled_power_w, bucket.modelled_power_w);
  widen(group_.speed_m_s, bucket.speed_m_s);
  measured_power_w_.add(bucket.measured_power_w.mean, weight_s);
  modelled_power_w_.add(bucket.modelled_power_w.mean, weight_s);
  speed_m_s_.add(bucket.speed_m_s.mean, weight_s);
  x_m_.add(bucket.x_m, weight_s);
  y_m_.add(bucket.y_m, weight_s);
  keep_last(group_.state_of_charge, bucket.state_of_charge);
  keep_last(group_.measured_j, bucket.measured_j);
  keep_last(group_.modelled_j, bucket.modelled_j);
}

Trace TraceMerger::finish() {
  end();
  return std::move(trace_);
}

std::int64_t merged_width_us(std::int64_t from_utime_us, std::int64_t to_utime_us, std::int64_t max_points) {
  assert(from_utime_us < to_utime_us && max_points > 0);
  // Unsigned: the range may be all of time.
  const auto span = static_cast<std::uint64_t>(to_utime_us) - static_cast<std::uint64_t>(from_utime_us);
  const auto bucket = static_cast<std::uint64_t>(trace_bucket_us);
  const auto points = static_cast<std::uint64_t>(max_points);
  const std::uint64_t buckets = span / bucket + (span % bucket != 0);
  const std::uint64_t width = buckets / points + (buckets % points != 0);
  constexpr std::uint64_t greatest = std::numeric_limits<std::int64_t>::max() / trace_bucket_us;
  return static_cast<std::int64_t>(std::min(width, greatest) * bucket);
}

}  // namespace joulecast::history
