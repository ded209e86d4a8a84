#pragma once

#include <optional>

#include "answers/model.h"
#include "describe/table.h"
#include "forecast/outlook.h"
#include "ingest/fleet_view.h"

namespace joulecast::api {

// Seconds since the last message, by the host's clock; NaN without a message.
double silence_s(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us);

// True if a message was received within the last 5 s.
bool is_live(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us);

const described::Table<ingest::Contradiction>& contradiction_table();
// For the fleet's event stream.
struct ContradictionEvent {
  const std::string& robot_id;
  const ingest::Contradiction& contradiction;
};
const described::Table<ContradictionEvent>& contradiction_event_table();

// The live state of a robot, for GET /v1/robots/{id}/state and the fleet's event stream.
struct LiveState {
  const ingest::RobotSnapshot& snapshot;
  const std::optional<forecast::Reach>& reach;  // by its forecast; empty when it has no model
  std::int64_t now_utime_us;
};
const described::Table<LiveState>& state_table();

// The members of a robot's snapshot that forecasts use; all absent if it is null.
answers::LiveRobot live_robot(const ingest::RobotSnapshot* snapshot);

}  // namespace joulecast::api
