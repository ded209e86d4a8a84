#pragma once

#include <optional>

#include "base/json_writer.h"
#include "forecast/outlook.h"
#include "ingest/fleet_view.h"

namespace joulecast::api {

// Seconds since the last message, by the host's clock; NaN without a message.
double silence_s(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us);

// True if a message was received within the last 5 s.
bool is_live(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us);

// The fields "charge" and "charging" of a robot's state.
void write_charge(JsonWriter& json, const ingest::ChargeView& charge);

void write_contradiction(JsonWriter& json, const ingest::Contradiction& contradiction);

// The live state of a robot, for GET /v1/robots/{id}/state and the fleet's event stream.
// `reach` is by the robot's forecast; empty when it has no model.
void write_state(JsonWriter& json, const ingest::RobotSnapshot& snapshot,
                 const std::optional<forecast::Reach>& reach, std::int64_t now_utime_us);

}  // namespace joulecast::api
