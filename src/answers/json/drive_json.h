#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "answers/drive.h"
#include "base/json_fields.h"
#include "base/json_writer.h"
#include "planning/profile.h"
#include "robot/robot_model.h"

// Members common to several answers.
namespace joulecast::answers {

inline constexpr std::array<std::string_view, 2> driving_names{"minimum_energy", "usual"};
inline const char* name_of(Driving driving) {
  return driving_names[static_cast<std::size_t>(driving)].data();
}

inline constexpr Bounds position_bounds_m{.minimum = -1e6, .maximum = 1e6};
inline constexpr Bounds dwell_bounds_s{.minimum = 0, .maximum = 1e7};

// Reads "driving".
Driving read_driving(Fields& fields, Driving fallback);

// Reads "start_pose"; empty where it is absent.
std::optional<planning::Pose> read_start_pose(Fields& fields);

// Reads "path".
std::vector<planning::Segment> read_path(Fields& fields, double payload_limit_kg);

// Reads "path" (segments), "start_pose", "payload_kg", "start_speed_m_s", "end_speed_m_s", "deadline_s",
// "value_of_time_w", "regeneration", and limits that tighten the robot's own, "limits". The fields' own
// faults are left in `fields`; the caller finishes it.
DriveInput read_drive(Fields& fields, const robot::RobotModel& robot);

// "profile": the columns of a motion.
void write_profile_columns(JsonWriter& json, const planning::Profile& profile);

// Values at the quantiles 5, 50 and 95 %.
void write_quantiles(JsonWriter& json, std::string_view name, const std::array<double, 3>& values);

}  // namespace joulecast::answers
