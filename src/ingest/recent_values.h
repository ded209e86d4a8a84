#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "ingest/fleet_view.h"

namespace joulecast::ingest {

inline constexpr std::int64_t recent_window_us = 90'000'000;
inline constexpr std::size_t most_recent_values = 90;  // of a robot

// A robot's live values at one moment; NaN: not measured.
struct RecentValue {
  std::int64_t utime_us = 0;  // robot's clock
  double measured_power_w = signals::unmeasured;
  double modelled_power_w = signals::unmeasured;
  double speed_m_s = signals::unmeasured;
  std::array<double, 3> pose{signals::unmeasured, signals::unmeasured, signals::unmeasured};  // m, m, rad
};

// The last 90 s of every robot's live values, at most one a second, for charts that begin filled: at most 5
// kB a robot. Any thread takes and reads.
class RecentValues {
 public:
  // Takes the snapshot's sample if it is a second younger than the last. A clock set back clears the values.
  void take(const RobotSnapshot& snapshot);
  // Removes robots for which `is_known(id)` is false.
  template <class Known>
  void keep(Known is_known) {
    const std::lock_guard lock(mutex_);
    std::erase_if(robots_, [&](const auto& each) { return !is_known(each.first); });
  }
  // Oldest first; empty if no value was received.
  std::vector<RecentValue> of(std::string_view robot_id) const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, std::deque<RecentValue>, std::less<>> robots_;  // oldest first
};

}  // namespace joulecast::ingest
