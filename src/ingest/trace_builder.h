#pragma once

#include <cstdint>
#include <vector>

#include "energy/meter.h"
#include "history/records.h"

namespace joulecast::ingest {

// Folds the meter's points into the store's one-second trace buckets.
class TraceBuilder {
 public:
  void begin();
  // `accounts` and `state_of_charge` (0 to 1; NaN: unknown) as of the point.
  void add(const energy::MeterPoint& point, const signals::Accounts& accounts, double state_of_charge);
  // The buckets that changed since the last call; the newest one may come again, fuller.
  std::vector<history::TraceBucket> take();

 private:
  // A running band: sums become the mean when the bucket is handed out.
  struct Sum {
    double weighted = 0, weight = 0;
    double min = signals::unmeasured, max = signals::unmeasured;
    void add(double value, double weight_s);
    history::Band band() const;
  };
  struct Open {
    std::int64_t start_utime_us = 0;
    double covered_s = 0;
    Sum measured, modelled, speed, x, y;
    history::TraceBucket bucket() const;
    double state_of_charge = signals::unmeasured, measured_j = signals::unmeasured,
           modelled_j = signals::unmeasured;
  };

  std::vector<history::TraceBucket> finished_;
  Open open_;
  bool any_ = false;
  bool touched_ = false;
};

}  // namespace joulecast::ingest
