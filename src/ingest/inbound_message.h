#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/error.h"
#include "history/store.h"
#include "ingest/counters.h"
#include "telemetry/codec.h"
#include "telemetry/datagram.h"

namespace joulecast::ingest {

// A message on a robot's channel that was refused before it was read; counted already.
struct RefusedMessage {
  IngestFault fault = IngestFault::undecodable;
  std::string why;
};

// A mission event of a scheduler, requested over HTTP for a robot that announces no missions. Requests are
// stored before they are answered; the daemon that keeps the robot carries each out once.
struct MissionRequest {
  signals::MissionEvent event;
  std::int64_t request_utime_us = 0;  // host clock; increases from one request of a robot to the next
};

// A received message that passed the guard, or that came on a channel of a configured robot; or a request.
struct InboundMessage {
  std::string robot_id;
  std::variant<signals::Sample, signals::MissionEvent, signals::CovariateMessage, RefusedMessage,
               MissionRequest>
      content;
  std::int64_t host_utime_us = 0;
  telemetry::Sender sender = {};
  std::int64_t one_of = 1;  // how many of the robot's samples at that time one was queued
};

// Of how many samples of a robot one is queued: of one while the queue is less than half full, of twice as
// many with each halving of its room. Beyond this number none is: the rest is for events.
inline constexpr std::int64_t most_thinning = 16;
std::int64_t thinning(std::size_t queued, std::size_t capacity);
// Whether a message is queued where one of so many samples is; samples are chosen by their sequence.
bool is_chosen(const InboundMessage& message, std::int64_t one_of);

class SignatureGate;

// Guards and decodes one message. Empty when its channel is none that robots publish on. Without `signatures`
// signed messages are taken unchecked, as from a log.
std::optional<InboundMessage> decode_message(std::string_view channel, std::span<const std::uint8_t> data,
                                             std::int64_t host_utime_us, IngestCounters& counters,
                                             const telemetry::Sender& sender = {},
                                             SignatureGate* signatures = nullptr);

// The newest requests of each robot, as learned of it (history::Learned) under this topic.
inline constexpr std::string_view mission_request_topic = "mission_requests";

// Oldest first. At most telemetry::MissionTracker::memory, the newest.
std::string mission_requests_json(std::span<const MissionRequest> requests);
// Those stored of a robot, oldest first. Fails as Store::learned does.
Result<std::vector<MissionRequest>> stored_mission_requests(const history::Store& store,
                                                            std::string_view robot_id);

// True if the store has the effect of an event: it begins or ends `newest`, its robot's last, or is older.
bool has_effect(const signals::MissionEvent& event, const history::Mission& newest);

}  // namespace joulecast::ingest
