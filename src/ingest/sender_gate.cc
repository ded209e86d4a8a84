#include "ingest/sender_gate.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace joulecast::ingest {
namespace {

constexpr std::int64_t second_us = 1'000'000;
// A sender that has missed this number of its usual intervals is gone, unless two came at once recently.
constexpr double missed_intervals = 50;
constexpr std::int64_t least_patience_us = second_us / 10;
constexpr std::int64_t contest_memory_us = 60 * second_us;
constexpr std::size_t waiting_units_a_robot = 16'384;
// Greatest loss between two samples of one stream.
constexpr std::int64_t stream_step = 1000, stream_span_us = 60 * second_us;
// Going back to a stream that was left happens to a robot that boots while its last datagrams are late; going
// back and forth does not.
constexpr int most_returns = 3;
constexpr std::int64_t returns_memory_us = 10 * second_us;
// Publishers that open a socket for each message go on with their numbers.
constexpr std::int64_t port_step = 16;

std::size_t message_units(const InboundMessage& message) {
  if (const auto* covariates = std::get_if<signals::CovariateMessage>(&message.content))
    return 1 + covariates->covariates.size() / 2;
  return std::holds_alternative<signals::MissionEvent>(message.content) ? 4 : 1;
}

}  // namespace

bool SenderGate::Stream::continued_by(const signals::Sample& sample) const {
  return sequence >= 0 && sample.sequence > sequence && sample.sequence - sequence <= stream_step &&
         std::abs(sample.utime_us - utime_us) <= stream_span_us;
}

bool SenderGate::is_of_first(const InboundMessage& message, const signals::Sample* sample) const {
  if (!any_ || message.sender == first_) return true;
  if (sample != nullptr) {
    // The same publisher from another port.
    return message.sender.address == first_.address && main_.continued_by(*sample) &&
           sample->sequence - main_.sequence <= port_step && (waiting_.empty() || message.sender != other_);
  }
  // Missions may be announced by another sender, such as a fleet manager.
  const bool waits = !waiting_.empty() && message.sender == other_;
  const bool live = message.host_utime_us - heard_us_ < takeover_us_;
  return !waits && !(announcer_ == first_ && live);
}

SenderGate::Verdict SenderGate::take(const InboundMessage& message) {
  const auto* sample = std::get_if<signals::Sample>(&message.content);
  heard_us_ = std::min(heard_us_, message.host_utime_us);  // the host's clock was set back
  std::vector<InboundMessage> released = release(message.host_utime_us);
  Verdict verdict = is_of_first(message, sample) ? take_first(message, sample) : take_other(message);
  verdict.released = std::move(released);
  return verdict;
}

SenderGate::Verdict SenderGate::take_first(const InboundMessage& message, const signals::Sample* sample) {
  Verdict verdict{.pass = true};
  if (sample == nullptr) {
    if (std::holds_alternative<signals::MissionEvent>(message.content)) announcer_ = message.sender;
    return verdict;
  }
  if (is_second_stream(*sample, message.host_utime_us)) return {.refused = 1};
  if (!waiting_.empty()) {
    contested_us_ = message.host_utime_us;
    verdict.refused = drop_waiting();
  }
  if (any_) interval_us_ += 0.1 * (static_cast<double>(message.host_utime_us - heard_us_) - interval_us_);
  any_ = true;
  first_ = message.sender;
  heard_us_ = message.host_utime_us;
  return verdict;
}

SenderGate::Verdict SenderGate::take_other(const InboundMessage& message) {
  const std::size_t needed = message_units(message);
  const bool third = !waiting_.empty() && message.sender != other_;
  if (third || needed > room_ || waiting_units_ + needed > waiting_units_a_robot) return {.refused = 1};
  other_ = message.sender;
  waiting_.push_back(message);
  waiting_units_ += needed;
  room_ -= needed;
  return {};
}

bool SenderGate::is_second_stream(const signals::Sample& sample, std::int64_t host_utime_us) {
  if (host_utime_us - returned_us_ > returns_memory_us) returns_ = 0;
  const Stream now{sample.sequence, sample.utime_us};
  if (main_.continued_by(sample) || main_.sequence < 0) {
    main_ = now;
    return false;
  }
  if (side_.continued_by(sample)) {
    returned_us_ = host_utime_us;
    if (++returns_ > most_returns && host_utime_us - heard_us_ < takeover_us_) {
      side_ = now;
      return true;
    }
    side_ = std::exchange(main_, now);
    return false;
  }
  const bool repeated =
      sample.sequence <= main_.sequence && main_.sequence - sample.sequence <= stream_step &&
      std::abs(sample.utime_us - main_.utime_us) <= stream_span_us && sample.utime_us <= main_.utime_us;
  if (!repeated) side_ = std::exchange(main_, now);
  return false;
}

std::int64_t SenderGate::patience_us(std::int64_t host_utime_us) const {
  if (contested_us_ > 0 && host_utime_us - contested_us_ < contest_memory_us) return takeover_us_;
  const double usual = missed_intervals * interval_us_;
  return std::min(takeover_us_,
                  std::max(least_patience_us, static_cast<std::int64_t>(std::min(usual, 1e12))));
}

std::vector<InboundMessage> SenderGate::release(std::int64_t host_utime_us) {
  if (waiting_.empty()) return {};
  std::int64_t& since_us = waiting_.front().host_utime_us;
  if (host_utime_us != std::numeric_limits<std::int64_t>::max()) {
    since_us = std::min(since_us, host_utime_us);
    if (host_utime_us - since_us < patience_us(host_utime_us)) return {};
  }
  return hand_over();
}

std::vector<InboundMessage> SenderGate::hand_over() {
  std::vector<InboundMessage> released(std::make_move_iterator(waiting_.begin()),
                                       std::make_move_iterator(waiting_.end()));
  heard_us_ = released.back().host_utime_us;
  first_ = other_;
  main_ = side_ = {};
  for (const InboundMessage& message : released) {
    if (const auto* sample = std::get_if<signals::Sample>(&message.content))
      main_ = {sample->sequence, sample->utime_us};
    if (std::holds_alternative<signals::MissionEvent>(message.content)) announcer_ = first_;
  }
  drop_waiting();
  return released;
}

std::size_t SenderGate::drop_waiting() {
  const std::size_t count = waiting_.size();
  waiting_.clear();
  room_ += std::exchange(waiting_units_, 0);
  return count;
}

std::string SenderGate::describe() const {
  if (returns_ > most_returns)
    return telemetry::to_string(first_) +
           " sends two streams of sequence numbers under this robot's id; the one at sequence " +
           std::to_string(side_.sequence) + " is not accounted for";
  return telemetry::to_string(other_) + " publishes under this robot's id in addition to " +
         telemetry::to_string(first_) + ", which alone is accounted for";
}

}  // namespace joulecast::ingest
