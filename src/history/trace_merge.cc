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

}  // namespace

void BucketSum::Sum::add(const Band& band, double weight_s) {
  if (std::isfinite(band.mean)) {
    weighted += weight_s * band.mean;
    weight += weight_s;
  }
  // fmin and fmax pass over NaN.
  min = std::fmin(min, band.min);
  max = std::fmax(max, band.max);
}

void BucketSum::add(const TraceBucket& bucket, double weight_s) {
  last_.covered_s += std::isnan(bucket.covered_s) ? 0 : bucket.covered_s;
  measured_power_w_.add(bucket.measured_power_w, weight_s);
  modelled_power_w_.add(bucket.modelled_power_w, weight_s);
  speed_m_s_.add(bucket.speed_m_s, weight_s);
  x_m_.add(single(bucket.x_m), weight_s);
  y_m_.add(single(bucket.y_m), weight_s);
  keep_last(last_.state_of_charge, bucket.state_of_charge);
  keep_last(last_.measured_j, bucket.measured_j);
  keep_last(last_.modelled_j, bucket.modelled_j);
}

TraceBucket BucketSum::bucket() const {
  TraceBucket sum = last_;
  sum.measured_power_w = measured_power_w_.band();
  sum.modelled_power_w = modelled_power_w_.band();
  sum.speed_m_s = speed_m_s_.band();
  sum.x_m = x_m_.band().mean;
  sum.y_m = y_m_.band().mean;
  return sum;
}

TraceMerger::TraceMerger(std::int64_t origin_utime_us, std::int64_t width_us)
    : origin_utime_us_(origin_utime_us) {
  assert(width_us > 0 && width_us % trace_bucket_us == 0);
  trace_.width_us = width_us;
}

void TraceMerger::add(const TraceBucket& bucket) {
  assert(bucket.start_utime_us >= origin_utime_us_);
  // Unsigned: two times may lie further apart than a signed difference holds.
  const auto offset =
      static_cast<std::uint64_t>(bucket.start_utime_us) - static_cast<std::uint64_t>(origin_utime_us_);
  const std::int64_t start =
      bucket.start_utime_us - static_cast<std::int64_t>(offset % static_cast<std::uint64_t>(trace_.width_us));
  if (group_ && start != group_->start_utime_us()) {
    trace_.buckets.push_back(group_->bucket());
    group_.reset();
  }
  if (!group_) group_.emplace(start);
  // A bucket of a single sample covers no time; it must still be shown, with negligible weight in the mean.
  constexpr double least_weight_s = 1e-9;
  group_->add(bucket, std::fmax(bucket.covered_s, least_weight_s));
}

Trace TraceMerger::finish() {
  if (group_) trace_.buckets.push_back(group_->bucket());
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
