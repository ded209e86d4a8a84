#pragma once

#include "robot/robot_model.h"
#include "server/api/json_writer.h"
#include "server/ingest/fleet_view.h"

namespace joulecast::api {

// Heard of within the last seconds.
bool is_live(const server::RobotSnapshot& snapshot, std::int64_t now_utime_us);

// The fields "charge" and "charging" of a robot's state.
void write_charge(JsonWriter& json, const server::ChargeView& charge);

// The live state of a robot: what GET /v1/robots/{id}/state answers and the fleet's event stream sends.
// `battery` is null when the robot has no model.
void write_state(JsonWriter& json, const server::RobotSnapshot& snapshot, const robot::Battery* battery,
                 std::int64_t now_utime_us);

}  // namespace joulecast::api
