#include "ingest/mission_requests.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "base/try.h"
#include "telemetry/mission_tracker.h"

namespace joulecast::ingest {

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
