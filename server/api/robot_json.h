#pragma once

#include <optional>

#include "base/json_writer.h"
#include "forecast/outlook.h"
#include "ingest/fleet_view.h"

namespace joulecast::api {

// Since the last message, by the host's clock; NaN when none came.
double silence_s(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us);

// Received from within the last seconds.
bool is_live(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us);

// The fields "charge" and "charging" of a robot's state.
void write_charge(JsonWriter& json, const ingest::ChargeView& charge);

void write_contradiction(JsonWriter& json, const ingest::Contradiction& contradiction);

// The live state of a robot: what GET /v1/robots/{id}/state answers and the fleet's event stream sends.
// `reach` is by the robot's forecast; empty when it has no model.
void write_state(JsonWriter& json, const ingest::RobotSnapshot& snapshot,
                 const std::optional<forecast::Reach>& reach, std::int64_t now_utime_us);

}  // namespace joulecast::api
