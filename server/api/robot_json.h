#pragma once

#include "robot/robot_model.h"
#include "server/api/json_writer.h"
#include "server/ingest/fleet_view.h"

namespace joulecast::api {

// The live state of a robot: what GET /v1/robots/{id}/state answers and the fleet's event stream sends.
// `battery` is null when the robot has no model. A robot not heard of for `live_s` is not live.
void write_state(JsonWriter& json, const server::RobotSnapshot& snapshot, const robot::Battery* battery,
                 std::int64_t now_utime_us);

}  // namespace joulecast::api
