#pragma once

#include <boost/core/noncopyable.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "ingest/inbound_message.h"

namespace joulecast::ingest {

// Accepts messages from one sender per robot. A second sender under the robot's id is distinguished by its
// address or, behind one address, by its own stream of sequence numbers. Its messages wait. They are rejected
// when the first sender sends again, so that no energy is counted twice; they pass when the first one has
// fallen silent, so that a robot with a restarted publisher or a changed address loses no data. Messages of
// unknown senders (logs) have the streams only.
class SenderGate : boost::noncopyable {
 public:
  // `takeover_us`: silence after which another sender takes over at the latest. `room`: units (about one
  // sample) that may wait in all gates together.
  SenderGate(std::int64_t takeover_us, std::size_t& room) : takeover_us_(takeover_us), room_(room) {}
  ~SenderGate() { drop_waiting(); }

  struct Verdict {
    std::vector<InboundMessage> released = {};  // pass first
    bool pass = false;                          // the message itself; else it waits or is refused
    std::size_t refused = 0;                    // it and such that waited
  };
  Verdict take(const InboundMessage& message);
  // Returns messages that have waited long enough; all of them when `now` is the end of time.
  std::vector<InboundMessage> release(std::int64_t host_utime_us);

  // The rejected sender and the accepted one.
  std::string describe() const;

 private:
  struct Stream {
    std::int64_t sequence = -1, utime_us = 0;
    // Sequence numbers count up and clocks agree.
    bool continued_by(const signals::Sample& sample) const;
  };

  Verdict take_first(const InboundMessage& message, const signals::Sample* sample);
  Verdict take_other(const InboundMessage& message);
  bool is_of_first(const InboundMessage& message, const signals::Sample* sample) const;
  bool is_second_stream(const signals::Sample& sample, std::int64_t host_utime_us);
  std::int64_t patience_us(std::int64_t host_utime_us) const;
  std::vector<InboundMessage> hand_over();
  std::size_t drop_waiting();

  std::int64_t takeover_us_;
  std::size_t& room_;
  telemetry::Sender first_, other_;
  telemetry::Sender
      announcer_;  // of the last event; where it is first_, no other sender is expected to announce missions
  bool any_ = false;                    // first_ is set
  std::int64_t heard_us_ = 0;           // of first_
  double interval_us_ = 0;              // between its messages
  std::int64_t contested_us_ = 0;       // when both were last received; 0: never
  std::deque<InboundMessage> waiting_;  // of other_, since the last message of first_
  std::size_t waiting_units_ = 0;
  Stream main_, side_;
  int returns_ = 0;  // to a stream that was left, lately
  std::int64_t returned_us_ = 0;
};

}  // namespace joulecast::ingest
