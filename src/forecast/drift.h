#pragma once

#include <cstdint>

namespace joulecast::forecast {

// Watches standardised scores for a lasting shift, two-sided CUSUM (Page 1954): either sum grows by the score
// less `slack` and alarms at `limit`. For independent scores of unit variance a false alarm comes about once
// in 4 e^8 / 2 missions by Siegmund's approximation; a shift of two deviations is detected after about 6.
class DriftWatch {
 public:
  static constexpr double slack = 0.5;
  static constexpr double limit = 8;
  static constexpr double most = 4;  // a single score counts no more than this

  // Returns 0, or on an alarm the number of scores since the shift began, the newest included. An alarm
  // restarts the watch.
  std::int64_t add(double score);

 private:
  double up_ = 0, down_ = 0;
  std::int64_t since_up_ = 0, since_down_ = 0;
};

}  // namespace joulecast::forecast
