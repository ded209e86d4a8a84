#pragma once

#include <cstdint>

#include "history/records.h"

namespace joulecast::history {

// Downsamples a trace while it is read: buckets put in by ascending start come out in groups of `width_us`, a
// multiple of trace_bucket_us, aligned to `origin_utime_us`. Of a group: least of the least, mean weighted by
// covered time, greatest of the greatest; position weighted likewise; the last available charge and
// cumulative energies.
class TraceMerger {
 public:
  TraceMerger(std::int64_t origin_utime_us, std::int64_t width_us);

  void add(const TraceBucket& bucket);
  Trace finish();

 private:
  // A weighted mean in the making.
  struct Mean {
    double weight = 0;
    double sum = 0;
    void add(double value, double with_weight);
    double value() const;
  };

  void begin(std::int64_t start_utime_us);
  void end();

  std::int64_t origin_utime_us_;
  Trace trace_;
  bool has_group_ = false;
  TraceBucket group_;
  Mean measured_power_w_, modelled_power_w_, speed_m_s_, x_m_, y_m_;
};

// The least multiple of trace_bucket_us that covers [from, to) in at most max_points groups; from < to,
// max_points > 0.
std::int64_t merged_width_us(std::int64_t from_utime_us, std::int64_t to_utime_us, std::int64_t max_points);

}  // namespace joulecast::history
