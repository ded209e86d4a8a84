#pragma once

#include <cstdint>
#include <optional>

#include "history/records.h"

namespace joulecast::history {

constexpr Band single(double value) {
  return {value, value, value};
}

// One bucket of others, or of single values, which come in order of time: the least of the least, the
// weighted mean and the greatest; position weighted likewise; the last known charge and energies.
class BucketSum {
 public:
  explicit BucketSum(std::int64_t start_utime_us) { last_.start_utime_us = start_utime_us; }

  std::int64_t start_utime_us() const { return last_.start_utime_us; }
  void add(const TraceBucket& bucket, double weight_s);
  TraceBucket bucket() const;

 private:
  struct Sum {
    double weighted = 0, weight = 0;
    double min = signals::unmeasured, max = signals::unmeasured;
    void add(const Band& band, double weight_s);
    Band band() const { return {min, weight > 0 ? weighted / weight : min, max}; }
  };

  TraceBucket last_;
  Sum measured_power_w_, modelled_power_w_, speed_m_s_, x_m_, y_m_;
};

// Downsamples a trace while it is read: buckets put in by ascending start come out in groups of `width_us`, a
// multiple of trace_bucket_us, aligned to `origin_utime_us`, weighted by covered time.
class TraceMerger {
 public:
  TraceMerger(std::int64_t origin_utime_us, std::int64_t width_us);

  void add(const TraceBucket& bucket);
  Trace finish();

 private:
  std::int64_t origin_utime_us_;
  Trace trace_;
  std::optional<BucketSum> group_;
};

// The least multiple of trace_bucket_us that covers [from, to) in at most max_points > 0 groups; from < to.
std::int64_t merged_width_us(std::int64_t from_utime_us, std::int64_t to_utime_us, std::int64_t max_points);

}  // namespace joulecast::history
