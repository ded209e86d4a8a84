#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "energy/meter.h"
#include "history/trace_merge.h"

namespace joulecast::ingest {

// Folds the meter's points into the store's one-second trace buckets.
class TraceBuilder {
 public:
  void begin();
  // `accounts` and `state_of_charge` (0 to 1; NaN: unknown, the latest known one stays) as of the point.
  void add(const energy::MeterPoint& point, const signals::Accounts& accounts, double state_of_charge);
  // The buckets that changed since the last call; the newest one may come again, fuller.
  std::vector<history::TraceBucket> take();

 private:
  std::vector<history::TraceBucket> finished_;
  std::optional<history::BucketSum> open_;
  bool touched_ = false;  // since the last take()
};

}  // namespace joulecast::ingest
