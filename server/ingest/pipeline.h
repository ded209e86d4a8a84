#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "base/error.h"
#include "server/ingest/robot_session.h"
#include "signals/mission_event.h"
#include "telemetry/codec.h"

namespace joulecast::server {

// A message off the wire that passed the guard.
struct InboundMessage {
  std::string robot_id;
  std::variant<signals::Sample, signals::MissionEvent, signals::CovariateMessage> content;
  std::int64_t host_utime_us = 0;
};

// Guards and decodes one message. Empty when it is not ours or is refused, which is counted.
std::optional<InboundMessage> decode_message(std::string_view channel, std::span<const std::uint8_t> data,
                                             std::int64_t host_utime_us, IngestCounters& counters);

// Decoded messages in, history out: one session a robot, in one thread. The daemon and the offline replay run
// this same code.
class Pipeline {
 public:
  Pipeline(const SessionSettings& settings, std::size_t max_robots, const ModelRegistry& models,
           SessionOutputs outputs);

  // Opens sessions for the missions that were open when the last daemon stopped.
  Result<void> recover();

  void handle(const InboundMessage& message);

  // Call about once a second.
  void tick(std::int64_t host_utime_us);
  // Publishes the snapshots that changed.
  // The host's clock was set: silence is counted on as if it had not been.
  void on_host_clock_step(std::int64_t host_utime_us, std::int64_t step_us);
  void publish();
  // Ends missions as if the robots had fallen silent for good; for offline replay.
  void finish();
  // Checkpoints all open missions, to be resumed by the next daemon.
  void suspend();

 private:
  RobotSession* session(const std::string& robot_id);
  void refresh_models();

  SessionSettings settings_;
  std::size_t max_robots_;
  const ModelRegistry& models_;
  SessionOutputs outputs_;
  std::uint64_t epoch_ = 0;
  std::map<std::string, std::unique_ptr<RobotSession>, std::less<>> sessions_;
};

}  // namespace joulecast::server
