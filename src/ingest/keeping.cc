#include "ingest/keeping.h"

#include <utility>

namespace joulecast::ingest {

void Keeping::grant(Grant grant) {
  const std::lock_guard lock(mutex_);
  kept_[grant.robot_id] = grant.epoch;
  orders_.grants.push_back(std::move(grant));
  has_orders_.store(true, std::memory_order_release);
}

void Keeping::withdraw(Withdrawal withdrawal) {
  const std::lock_guard lock(mutex_);
  const auto found = kept_.find(withdrawal.robot_id);
  if (found == kept_.end() || found->second != withdrawal.epoch) return;
  kept_.erase(found);
  std::erase_if(orders_.grants, [&](const Grant& grant) { return grant.robot_id == withdrawal.robot_id; });
  orders_.withdrawals.push_back(std::move(withdrawal));
  has_orders_.store(true, std::memory_order_release);
}

std::map<std::string, std::int64_t> Keeping::heard() const {
  const std::lock_guard lock(mutex_);
  return {heard_.begin(), heard_.end()};
}

void Keeping::forget_heard() {
  const std::lock_guard lock(mutex_);
  heard_.clear();
}

void Keeping::note_leases(Leases leases) {
  const std::lock_guard lock(mutex_);
  leases_ = std::move(leases);
}

std::optional<Keeping::Leases> Keeping::take_leases() {
  const std::lock_guard lock(mutex_);
  return std::exchange(leases_, std::nullopt);
}

Keeping::Orders Keeping::take_orders() {
  const std::lock_guard lock(mutex_);
  has_orders_.store(false, std::memory_order_release);
  return std::exchange(orders_, {});
}

void Keeping::hear(std::string_view robot_id, std::int64_t host_utime_us) {
  const std::lock_guard lock(mutex_);
  if (const auto found = heard_.find(robot_id); found != heard_.end())
    found->second = host_utime_us;
  else
    heard_.emplace(robot_id, host_utime_us);
}

history::Epoch Keeping::epoch_of(std::string_view robot_id) const {
  const std::lock_guard lock(mutex_);
  const auto found = kept_.find(robot_id);
  return found == kept_.end() ? 0 : found->second;
}

std::map<std::string, history::Epoch, std::less<>> Keeping::kept() const {
  const std::lock_guard lock(mutex_);
  return kept_;
}

}  // namespace joulecast::ingest
