#include "ingest/keeping.h"

#include <algorithm>
#include <utility>

namespace joulecast::ingest {
namespace {

// Memory that a message holds.
std::size_t weight_of(const InboundMessage& message) {
  std::size_t bytes = sizeof(InboundMessage) + message.robot_id.size();
  if (const auto* event = std::get_if<signals::MissionEvent>(&message.content))
    bytes += event->mission_id.size() + event->note.size();
  if (const auto* covariates = std::get_if<signals::CovariateMessage>(&message.content))
    for (const signals::Covariate& each : covariates->covariates) bytes += sizeof(each) + each.name.size();
  return bytes;
}

// How many of the messages came so long before the last sample up to the position.
std::size_t stored_count(const std::deque<InboundMessage>& held, const history::StreamPosition& position,
                         std::int64_t age_us) {
  std::int64_t stored_host_us = INT64_MIN;
  for (const InboundMessage& message : held) {
    const auto* sample = std::get_if<signals::Sample>(&message.content);
    if (sample == nullptr) continue;
    if (sample->utime_us > position.utime_us) break;
    stored_host_us = message.host_utime_us;
  }
  if (stored_host_us == INT64_MIN) return 0;
  const auto first_kept = std::ranges::find_if(
      held, [&](const InboundMessage& message) { return stored_host_us - message.host_utime_us <= age_us; });
  return static_cast<std::size_t>(first_kept - held.begin());
}

}  // namespace

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

std::size_t HeldMessages::add(const InboundMessage& message) {
  const std::size_t weight = weight_of(message);
  if (weight > room_bytes_) return 1;
  std::size_t gave_way = 0;
  while (bytes_ + weight > room_bytes_) {
    auto& most =
        std::ranges::max_element(robots_, {}, [](const auto& each) { return each.second.size(); })->second;
    // A tenth at a time: finding the robot takes its time.
    const std::size_t part = std::min(most.size(), std::max<std::size_t>(1, most.size() / 10));
    drop_first(most, part);
    gave_way += part;
  }
  robots_[message.robot_id].push_back(message);
  ++size_;
  bytes_ += weight;
  return gave_way;
}

std::deque<InboundMessage> HeldMessages::take(std::string_view robot_id) {
  const auto found = robots_.find(robot_id);
  if (found == robots_.end()) return {};
  std::deque<InboundMessage> held = found->second;
  drop_first(found->second, held.size());
  robots_.erase(found);
  return held;
}

void HeldMessages::drop_first(std::deque<InboundMessage>& held, std::size_t count) {
  size_ -= count;
  for (; count > 0; --count, held.pop_front()) bytes_ -= weight_of(held.front());
}

void HeldMessages::forget_stored(std::int64_t host_utime_us, const Keeping::Leases& leases, bool now_read) {
  for (auto each = robots_.begin(); each != robots_.end();) {
    auto& [robot_id, held] = *each;
    const auto lease = leases.find(robot_id);
    std::size_t count = 0;
    if (lease == leases.end()) {
      const auto first_kept = std::ranges::find_if(held, [&](const InboundMessage& message) {
        return host_utime_us - message.host_utime_us <= age_us_;
      });
      count = static_cast<std::size_t>(first_kept - held.begin());
    } else if (now_read && lease->second) {
      count = stored_count(held, *lease->second, age_us_);
    }
    drop_first(held, count);
    each = held.empty() ? robots_.erase(each) : std::next(each);
  }
}

}  // namespace joulecast::ingest
