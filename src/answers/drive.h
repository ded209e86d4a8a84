#pragma once

#include <array>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "answers/model.h"
#include "describe/input.h"
#include "describe/table.h"
#include "planning/cost_matrix.h"
#include "planning/path.h"
#include "planning/problem.h"
#include "robot/robot_model.h"

namespace joulecast::answers {

// How a robot drives where only the way is given: by the planner's profiles, or as it usually does.
enum class Driving { minimum_energy, usual };

inline constexpr double most_value_of_time_w = 1e6;

// A way from where the robot is.
struct Way {
  std::vector<planning::Segment> path;
  std::optional<planning::Stations> stations = {};  // the path fetches at one and brings to the other
  std::string_view member = "path";                 // of the request, that gives the path
  bool placed = true;   // false: distances without turns, which end at no known place
  bool former = false;  // given by members of the version before

  bool halts_stated() const { return stations && stations->halts_stated(); }
};

// A way and how it is to be driven.
struct DriveInput {
  Way way;
  planning::PathOptions options;
  planning::Problem problem;
};

// Errors name "/path/<index>/<field>".
Result<planning::Path> path_of(const Way& way, const planning::PathOptions& options);

// True if the path will be a single run of few knots for any numbers: one straight, one turn in place or one
// short arc, with any dwells and changes of payload. Takes no time.
bool is_brief(const std::vector<planning::Segment>& segments);

inline constexpr std::array<std::string_view, 2> driving_names{"minimum_energy", "usual"};
inline const char* name_of(Driving driving) {
  return driving_names[static_cast<std::size_t>(driving)].data();
}

inline constexpr Bounds position_bounds_m{.minimum = -1e6, .maximum = 1e6};
inline constexpr Bounds dwell_bounds_s{.minimum = 0, .maximum = 1e7};

inline constexpr Bounds heading_bounds_rad{.minimum = -1e3, .maximum = 1e3};
inline constexpr const char* heading_words = "direction on the map, anticlockwise from the x axis";
inline constexpr Bounds value_of_time_bounds_w{.minimum = 0, .maximum = most_value_of_time_w};

// Refuses these members, which apply only to a planned motion.
void refuse_beside_usual(Fields& fields, std::initializer_list<const char*> names);

inline constexpr std::string_view payload_limit_member = "limits/payload_kg of the robot file";

// The context of the reader of a way.
struct PathContext {
  double payload_limit_kg = std::numeric_limits<double>::infinity();  // of the robot, where it is known
  bool may_stand = false;                                             // no way is none
};

inline described::Limit payload_limit(const auto&, const PathContext& context) {
  return {context.payload_limit_kg, payload_limit_member};
}

// "x_m" and "y_m".
template <class T>
described::Input<T> point_input(std::string_view words) {
  return described::Input<T>()
      .number("x_m", &T::x_m, position_bounds_m, words)
      .number("y_m", &T::y_m, position_bounds_m, words);
}

const described::Input<planning::Pose>& pose_input();

// "pickup", "dropoff", "pickup_dwell_s" and "dropoff_dwell_s".
const described::Input<planning::Stations>& stations_input();
// "path", or "distances_m" and "turns_rad".
const described::Input<Way, PathContext>& route_input();
// A route, or stations with "payload_kg" carried between them.
const described::Input<Way, PathContext>& way_input();
// One of these gives a way.
inline constexpr std::array<std::string_view, 4> way_members{"path", "distances_m", "turns_rad", "pickup"};
// "turn_rad" and "distance_m" of the version before: a further turn and a further straight.
const described::Input<Way, PathContext>& former_way_input();

// A way, "start_pose", "payload_kg", "start_speed_m_s", "end_speed_m_s", "deadline_s", "value_of_time_w",
// "regeneration", and limits that tighten those of the drive, "limits".
const described::Input<DriveInput, PathContext>& drive_input();

// A drive with the limits of the robot.
DriveInput undriven(const robot::RobotModel& robot);

// "path", "station", "pose", "limits" and "quantiles", to which other schemas refer.
described::Schemas drive_schemas();

// Values at the quantiles 5, 50 and 95 %.
using Quantiles = std::array<double, 3>;
const described::Table<Quantiles>& quantiles_table();

// "robot_id" and "model_version".
const described::Table<ModelInForce>& model_table();

// The columns of a motion.
const described::Table<planning::Profile>& columns_table(bool null_positions);

}  // namespace joulecast::answers
