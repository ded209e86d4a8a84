#include "ingest/fleet_view.h"

#include <mutex>
#include <utility>

namespace joulecast::ingest {

void FleetView::publish(std::shared_ptr<const RobotSnapshot> snapshot) {
  {
    const std::shared_lock lock(mutex_);
    if (const auto found = slots_.find(snapshot->robot_id); found != slots_.end()) {
      found->second->latest.store(std::move(snapshot), std::memory_order_release);
      return;
    }
  }
  const std::unique_lock lock(mutex_);
  auto& slot = slots_[snapshot->robot_id];
  if (slot == nullptr) slot = std::make_unique<Slot>();
  slot->latest.store(std::move(snapshot), std::memory_order_release);
}

void FleetView::remove(std::string_view robot_id) {
  const std::unique_lock lock(mutex_);
  if (const auto found = slots_.find(robot_id); found != slots_.end()) slots_.erase(found);
}

std::shared_ptr<const RobotSnapshot> FleetView::find(std::string_view robot_id) const {
  const std::shared_lock lock(mutex_);
  const auto found = slots_.find(robot_id);
  return found == slots_.end() ? nullptr : found->second->latest.load(std::memory_order_acquire);
}

std::vector<std::shared_ptr<const RobotSnapshot>> FleetView::all() const {
  const std::shared_lock lock(mutex_);
  std::vector<std::shared_ptr<const RobotSnapshot>> snapshots;
  snapshots.reserve(slots_.size());
  for (const auto& [id, slot] : slots_) snapshots.push_back(slot->latest.load(std::memory_order_acquire));
  return snapshots;
}

}  // namespace joulecast::ingest
