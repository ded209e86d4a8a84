#include "ingest/recent_values.h"

namespace joulecast::ingest {
namespace {

// Snapshots are taken once a second, with some jitter.
constexpr std::int64_t least_apart_us = 900'000;

}  // namespace

void RecentValues::take(const RobotSnapshot& snapshot) {
  const std::int64_t now_us = snapshot.sample.utime_us;
  // A snapshot restored from the store has no live values.
  if (now_us == 0 || snapshot.samples == 0) return;
  const std::lock_guard lock(mutex_);
  std::deque<RecentValue>& values = robots_[snapshot.robot_id];
  if (!values.empty() && now_us < values.back().utime_us) values.clear();
  if (!values.empty() && now_us - values.back().utime_us < least_apart_us) return;
  values.push_back({now_us, snapshot.measured_power_w, snapshot.modelled_power_w, snapshot.speed_m_s,
                    snapshot.sample.pose});
  if (values.size() > most_recent_values) values.pop_front();
}

std::vector<RecentValue> RecentValues::of(std::string_view robot_id) const {
  std::vector<RecentValue> found;
  const std::lock_guard lock(mutex_);
  const auto at = robots_.find(robot_id);
  if (at == robots_.end()) return found;
  for (const RecentValue& value : at->second)
    if (at->second.back().utime_us - value.utime_us < recent_window_us) found.push_back(value);
  return found;
}

}  // namespace joulecast::ingest
