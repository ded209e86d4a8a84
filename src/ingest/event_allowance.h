#pragma once

#include <algorithm>
#include <cstdint>

namespace joulecast::ingest {

// Rate limit of a robot's mission events: a token bucket that is refilled by time and by samples, because
// recordings are replayed faster than they were made.
class EventAllowance {
 public:
  explicit EventAllowance(double rate_hz) : rate_hz_(rate_hz) {}

  void earn_by_sample() { earn(a_sample); }

  // Takes one event; returns false if the allowance is used up.
  bool spend(std::int64_t host_utime_us) {
    earn(1e-6 * static_cast<double>(std::max<std::int64_t>(0, host_utime_us - earned_utime_us_)) * rate_hz_);
    earned_utime_us_ = host_utime_us;
    if (left_ < 1) return false;
    --left_;
    return true;
  }

  void give_back() { ++left_; }

 private:
  static constexpr double at_once = 100, a_sample = 0.2;

  void earn(double events) { left_ = std::min(at_once, left_ + events); }

  double rate_hz_;
  double left_ = at_once;
  std::int64_t earned_utime_us_ = 0;  // host's, when it was last earned with time
};

}  // namespace joulecast::ingest
