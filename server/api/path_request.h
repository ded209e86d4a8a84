#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "planning/path.h"
#include "planning/problem.h"
#include "server/api/fields.h"

namespace joulecast::api {

// A path with the way it is to be driven: what profile, estimate and matrix requests share.
struct DriveRequest {
  planning::Path path;
  planning::Problem problem;
};

// Reads "start_pose"; nothing where it is absent.
std::optional<planning::Pose> read_start_pose(Fields& fields);

// Reads "path" (segments); nothing when it is faulty, which `fields` then tells.
std::optional<planning::Path> read_path(Fields& fields, const planning::PathOptions& options,
                                        double payload_limit_kg);

// Reads "path" (segments), "start_pose", "payload_kg", "start_speed_m_s", "end_speed_m_s", "deadline_s",
// "value_of_time_w", "regeneration", and limits that tighten the robot's own, "limits". The fields' own
// faults are left in `fields`; the caller finishes it.
DriveRequest read_drive(Fields& fields, const robot::RobotModel& robot);

}  // namespace joulecast::api
