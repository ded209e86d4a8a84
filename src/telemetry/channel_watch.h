#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "signals/gaps.h"
#include "signals/sample.h"
#include "telemetry/codec.h"
#include "telemetry/datagram.h"
#include "telemetry/sequence_tracker.h"

namespace joulecast::telemetry {

// One number of a channel's messages.
struct FieldTally {
  std::string name;            // of the message, with part or index: "motor_current.right"
  std::uint64_t measured = 0;  // messages in which it was a number
  std::uint64_t changes = 0;   // of those with another value than the one before
  double last = signals::unmeasured, least = signals::unmeasured, greatest = signals::unmeasured;

  void take(double value);
};

// Counts of one channel of the contract.
struct ChannelTally {
  Subject subject = Subject::telemetry;
  std::string robot_id;
  std::uint64_t messages = 0, bytes = 0;
  std::int64_t first_utime_us = 0, last_utime_us = 0;  // of receiving
  std::int64_t longest_silence_us = 0;                 // between two messages, as received
  std::string last_text;                               // of an event: "finished m-12"
  std::vector<FieldTally> fields;                      // in the order of the message; of events none
  std::uint64_t powered = 0;                           // messages with voltage and current of the battery
  SequenceCounters sequence;                           // of telemetry
  std::uint64_t gaps = 0, bridged = 0;                 // steps of telemetry: signals/gaps.h
  double bridged_s = 0;                                // of the bridged steps
  std::int64_t clock_ahead_us = 0;  // of the message's stamp before its receiving; the last
  std::vector<Sender> senders;      // its senders, of UDP; the first few
  // Messages that joulecastd would reject, by its reasons ("undecodable", "wrong_channel", "implausible"),
  // with a sentence on the last.
  std::map<std::string, std::pair<std::uint64_t, std::string>> faults;

  // Messages a second; of telemetry without gaps, else over the whole time; 0 for fewer than two.
  [[nodiscard]] double rate_hz() const;
};

// Collects statistics of each channel's messages for a person. Not thread-safe.
class ChannelWatch {
 public:
  // A message as received at that time, host clock; false for a channel that is none of the contract's.
  bool add(std::string_view channel, std::span<const std::uint8_t> data, std::int64_t recv_utime_us,
           const Sender& sender = {});
  // A sample that came in no message: from a table.
  void add(const std::string& robot_id, const signals::Sample& sample);

  // By channel.
  [[nodiscard]] const std::map<std::string, ChannelTally, std::less<>>& channels() const { return channels_; }

 private:
  ChannelTally& begin(const std::string& channel, Subject subject, std::string_view robot_id,
                      std::int64_t recv_utime_us);
  void take(ChannelTally& tally, const std::string& robot_id, const signals::Sample& sample,
            std::int64_t recv_utime_us);
  void decode(ChannelTally& tally, std::span<const std::uint8_t> data, std::int64_t recv_utime_us);

  std::map<std::string, ChannelTally, std::less<>> channels_;
  struct Stream {
    SequenceTracker sequence;
    signals::GapDetector gaps;
  };
  std::map<std::string, Stream, std::less<>> streams_;  // by robot
};

}  // namespace joulecast::telemetry
