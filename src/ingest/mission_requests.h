#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "history/store.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// A mission event of a scheduler, requested over HTTP for a robot that announces no missions. Requests are
// stored before they are answered; the daemon that keeps the robot carries each out once.
struct MissionRequest {
  signals::MissionEvent event;
  std::int64_t request_utime_us = 0;  // host clock; increases from one request of a robot to the next
};

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
