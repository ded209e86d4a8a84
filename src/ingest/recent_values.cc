#include "ingest/recent_values.h"

namespace joulecast::ingest {
namespace {

// Snapshots are looked at once a second, not quite as evenly as robots speak.
constexpr std::int64_t least_apart_us = 900'000;

}  // namespace

void RecentValues::take(const RobotSnapshot& snapshot) {
  const std::int64_t now_us = snapshot.sample.utime_us;
  // What was only recalled from the store has no live values.
  if (now_us == 0 || snapshot.samples == 0) return;
  const std::lock_guard lock(mutex_);
  Ring& ring = robots_[snapshot.robot_id];
  if (ring.count > 0) {
    const std::int64_t newest_us = ring.newest().utime_us;
    if (now_us < newest_us)
      ring.count = 0;
    else if (now_us - newest_us < least_apart_us)
      return;
  }
  ring.values[ring.next] = {now_us, snapshot.measured_power_w, snapshot.modelled_power_w, snapshot.speed_m_s,
                            snapshot.sample.pose};
  ring.next = (ring.next + 1) % most_recent_values;
  if (ring.count < most_recent_values) ++ring.count;
}

std::vector<RecentValue> RecentValues::of(std::string_view robot_id) const {
  std::vector<RecentValue> found;
  const std::lock_guard lock(mutex_);
  const auto at = robots_.find(robot_id);
  if (at == robots_.end() || at->second.count == 0) return found;
  const Ring& ring = at->second;
  const std::int64_t newest_us = ring.newest().utime_us;
  for (std::size_t k = 0; k < ring.count; ++k) {
    const RecentValue& value =
        ring.values[(ring.next + most_recent_values - ring.count + k) % most_recent_values];
    if (newest_us - value.utime_us < recent_window_us) found.push_back(value);
  }
  return found;
}

}  // namespace joulecast::ingest
