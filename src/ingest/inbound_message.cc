#include "ingest/inbound_message.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_number.h"
#include "base/try.h"
#include "ingest/signature_gate.h"
#include "telemetry/mission_tracker.h"

namespace joulecast::ingest {

std::int64_t thinning(std::size_t queued, std::size_t capacity) {
  const std::size_t room = capacity - std::min(capacity, queued);
  return static_cast<std::int64_t>(std::bit_floor(capacity / std::max<std::size_t>(room, 1)));
}

bool is_chosen(const InboundMessage& message, std::int64_t one_of) {
  const auto* sample = std::get_if<signals::Sample>(&message.content);
  return sample == nullptr || (one_of <= most_thinning && sample->sequence % one_of == 0);
}

std::optional<InboundMessage> decode_message(std::string_view channel, std::span<const std::uint8_t> data,
                                             std::int64_t host_utime_us, IngestCounters& counters,
                                             const telemetry::Sender& sender, SignatureGate* signatures) {
  const std::optional<telemetry::ChannelName> name = telemetry::parse_channel(channel);
  if (!name || name->subject == telemetry::Subject::energy_state) return std::nullopt;
  ++counters.messages;
  InboundMessage message{std::string(name->robot_id), {}, host_utime_us, sender};
  const auto refuse = [&](IngestFault fault, std::string why) {
    counters.add(fault);
    message.content = RefusedMessage{fault, std::string(channel) + ": " + std::move(why)};
  };
  if (signatures != nullptr) {
    if (auto refusal = signatures->check(channel, name->robot_id, data, host_utime_us)) {
      refuse(refusal->fault, std::move(refusal->why));
      return message;
    }
  }
  const auto take = [&](auto decoded, auto part) {
    if (!decoded) {
      refuse(IngestFault::undecodable, describe(decoded.error()));
    } else if (decoded->robot_id != name->robot_id) {
      refuse(IngestFault::wrong_channel, "carries messages of robot_id " + decoded->robot_id);
    } else {
      message.content = std::move((*decoded).*part);
    }
  };
  switch (name->subject) {
    case telemetry::Subject::telemetry:
      take(telemetry::decode_telemetry(data), &telemetry::DecodedTelemetry::sample);
      break;
    case telemetry::Subject::covariates:
      take(telemetry::decode_covariates(data), &telemetry::DecodedCovariates::message);
      break;
    case telemetry::Subject::mission_event:
    case telemetry::Subject::energy_state:
      take(telemetry::decode_mission_event(data), &telemetry::DecodedMissionEvent::event);
      break;
  }
  return message;
}

std::string mission_requests_json(std::span<const MissionRequest> requests) {
  constexpr std::size_t most = telemetry::MissionTracker::memory;
  nlohmann::json all = nlohmann::json::array();
  for (const auto& [event, request_utime_us] : requests.last(std::min(most, requests.size())))
    all.push_back({{"request_utime_us", request_utime_us},
                   {"utime_us", event.utime_us},
                   {"mission_id", event.mission_id},
                   {"phase", static_cast<int>(event.phase)},
                   {"payload_kg", json_number(event.payload_kg)},
                   {"note", event.note}});
  return json_text(all);
}

Result<std::vector<MissionRequest>> stored_mission_requests(const history::Store& store,
                                                            std::string_view robot_id) {
  TRY_ASSIGN(const auto stored, store.learned(robot_id, mission_request_topic));
  std::vector<MissionRequest> requests;
  if (!stored.has_value()) return requests;
  const auto all = nlohmann::json::parse(stored->body_json, nullptr, false);
  if (!all.is_array()) return requests;
  for (const nlohmann::json& each : all) {
    requests.push_back({{each.at("utime_us").get<std::int64_t>(), each.at("mission_id").get<std::string>(),
                         static_cast<signals::MissionPhase>(each.at("phase").get<int>()),
                         number_or_nan(each.at("payload_kg")), each.at("note").get<std::string>()},
                        each.at("request_utime_us").get<std::int64_t>()});
  }
  return requests;
}

bool has_effect(const signals::MissionEvent& event, const history::Mission& newest) {
  if (event.utime_us < newest.start_utime_us) return true;
  if (event.mission_id != newest.mission_id) return false;
  return event.phase == signals::MissionPhase::started ? event.utime_us == newest.start_utime_us
                                                       : newest.state != history::MissionState::open;
}

}  // namespace joulecast::ingest
