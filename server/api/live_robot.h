#pragma once

#include "answers/live.h"
#include "ingest/fleet_view.h"

namespace joulecast::api {

// The members of a robot's snapshot that forecasts use; all absent if it is null.
answers::LiveRobot live_robot(const ingest::RobotSnapshot* snapshot);

}  // namespace joulecast::api
