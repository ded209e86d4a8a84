#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "ingest/inbound_message.h"

namespace joulecast::ingest {

// The last messages of robots that another daemon of the cluster keeps, for when this one has to go on in its
// place. Bounded by age and, over all robots, by number: the robot that has most loses its oldest.
class HeldMessages {
 public:
  HeldMessages(std::int64_t age_us, std::size_t room) : age_us_(age_us), room_(room) {}

  // Answers how many were discarded for want of room.
  std::size_t add(const InboundMessage& message);
  // The robot's, oldest first; they are no longer held.
  std::deque<InboundMessage> take(std::string_view robot_id);
  void forget_older(std::int64_t host_utime_us);
  std::size_t size() const { return size_; }

 private:
  std::int64_t age_us_;
  std::size_t room_;
  std::size_t size_ = 0;
  std::map<std::string, std::deque<InboundMessage>, std::less<>> robots_;
};

}  // namespace joulecast::ingest
