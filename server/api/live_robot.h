#pragma once

#include "answers/live.h"
#include "ingest/fleet_view.h"

namespace joulecast::api {

// What answers need of a robot's snapshot; nothing is known where it is null.
answers::LiveRobot live_robot(const ingest::RobotSnapshot* snapshot);

}  // namespace joulecast::api
