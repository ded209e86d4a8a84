#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>

#include "ingest/inbound_message.h"
#include "ingest/keeping.h"

namespace joulecast::ingest {

// The messages of robots that another daemon of the cluster keeps, since those that it has stored, for when
// this daemon has to go on in its place. Bounded by bytes in all: the robot with most loses its oldest.
class HeldMessages {
 public:
  // `age_us`: how long messages are kept of a robot without a lease, and before the last stored sample of one
  // with a lease, since events from then may not be stored yet.
  HeldMessages(std::int64_t age_us, std::size_t room_bytes) : age_us_(age_us), room_bytes_(room_bytes) {}

  // Answers how many were discarded for want of room.
  std::size_t add(const InboundMessage& message);
  // The robot's, oldest first; they are no longer held.
  std::deque<InboundMessage> take(std::string_view robot_id);
  // Drops stored messages. `now_read`: leases were just read; else messages of robots with leases are kept.
  void forget_stored(std::int64_t host_utime_us, const Keeping::Leases& leases, bool now_read);
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return bytes_; }

 private:
  void drop_first(std::deque<InboundMessage>& held, std::size_t count);

  std::int64_t age_us_;
  std::size_t room_bytes_;
  std::size_t size_ = 0, bytes_ = 0;
  std::map<std::string, std::deque<InboundMessage>, std::less<>> robots_;
};

}  // namespace joulecast::ingest
