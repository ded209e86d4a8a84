#pragma once

#include <cstddef>
#include <cstdint>

#include "signals/gaps.h"

namespace joulecast::plausibility {

// True if a value is far from the level of both its neighbours, which are alike.
bool is_spike(double before, double value, double after);

// Statistics of one reading's values, in constant memory.
class ValueTally {
 public:
  void add(double value);  // NaN: none
  void append(const ValueTally& other);

  std::size_t known() const { return known_; }
  double low() const { return low_; }
  double high() const { return high_; }
  bool constant() const { return known_ > 0 && low_ == high_; }
  double mean() const;
  double deviation() const;  // standard

 private:
  std::size_t known_ = 0;
  double origin_ = 0, sum_ = 0, square_ = 0, low_ = 0, high_ = 0;
};

// Statistics of the clock and the sequence numbers of a mission.
class ClockTally {
 public:
  void add(std::int64_t utime_us, std::int64_t sequence);

  std::size_t rows() const { return rows_; }
  std::int64_t first_us() const { return first_us_; }
  double length_s() const { return 1e-6 * static_cast<double>(last_us_ - first_us_); }
  // Mean time between rows without gaps; 0 without two that differ. A step much shorter than the one before
  // is excluded: an import inserts such steps before changes of a held reading (hold), and publishers catch
  // up with such steps after a stall. So is the step after one back.
  double period_s() const;
  std::size_t repeated() const { return repeated_; }  // same time as the row before
  std::size_t backward() const { return backward_; }  // earlier than the row before
  // As defined in signals/gaps.h.
  struct Steps {
    std::size_t count = 0;
    double seconds = 0;
  };
  Steps gaps() const;
  // Rows with a sequence number that is not above that of the row before.
  std::size_t disordered() const { return disordered_; }
  bool counts() const { return low_sequence_ != high_sequence_; }

 private:
  std::size_t rows_ = 0, repeated_ = 0, backward_ = 0, disordered_ = 0;
  std::int64_t first_us_ = 0, last_us_ = 0, before_us_ = 0, step_us_ = 0, sequence_ = 0;
  std::int64_t low_sequence_ = 0, high_sequence_ = 0;
  signals::GapDetector detector_;
  Steps steps_, gaps_;
};

}  // namespace joulecast::plausibility
