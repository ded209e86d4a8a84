#include "ingest/held_messages.h"

#include <algorithm>
#include <utility>

namespace joulecast::ingest {

std::size_t HeldMessages::add(const InboundMessage& message) {
  if (room_ == 0) return 1;
  std::size_t gave_way = 0;
  if (size_ >= room_) {
    auto& most =
        std::ranges::max_element(robots_, {}, [](const auto& each) { return each.second.size(); })->second;
    // A tenth at a time: finding the robot takes its time.
    gave_way = std::min(most.size(), std::max<std::size_t>(1, most.size() / 10));
    most.erase(most.begin(), most.begin() + static_cast<std::ptrdiff_t>(gave_way));
    size_ -= gave_way;
  }
  robots_[message.robot_id].push_back(message);
  ++size_;
  return gave_way;
}

std::deque<InboundMessage> HeldMessages::take(std::string_view robot_id) {
  const auto found = robots_.find(robot_id);
  if (found == robots_.end()) return {};
  std::deque<InboundMessage> held = std::move(found->second);
  robots_.erase(found);
  size_ -= held.size();
  return held;
}

void HeldMessages::forget_older(std::int64_t host_utime_us) {
  for (auto each = robots_.begin(); each != robots_.end();) {
    std::deque<InboundMessage>& held = each->second;
    while (!held.empty() && host_utime_us - held.front().host_utime_us > age_us_) {
      held.pop_front();
      --size_;
    }
    held.empty() ? each = robots_.erase(each) : ++each;
  }
}

}  // namespace joulecast::ingest
