#include "ingest/fleet_view.h"

#include <utility>

namespace joulecast::ingest {

void FleetView::publish(std::shared_ptr<const RobotSnapshot> snapshot) {
  const std::lock_guard lock(mutex_);
  // The one before is freed after the lock is.
  std::swap(latest_[snapshot->robot_id], snapshot);
}

void FleetView::remove(std::string_view robot_id) {
  const std::lock_guard lock(mutex_);
  if (const auto found = latest_.find(robot_id); found != latest_.end()) latest_.erase(found);
}

std::shared_ptr<const RobotSnapshot> FleetView::find(std::string_view robot_id) const {
  const std::lock_guard lock(mutex_);
  const auto found = latest_.find(robot_id);
  return found == latest_.end() ? nullptr : found->second;
}

std::vector<std::shared_ptr<const RobotSnapshot>> FleetView::all() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<const RobotSnapshot>> snapshots;
  snapshots.reserve(latest_.size());
  for (const auto& [id, snapshot] : latest_) snapshots.push_back(snapshot);
  return snapshots;
}

}  // namespace joulecast::ingest
