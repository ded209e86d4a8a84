#pragma once

#include <optional>
#include <vector>

#include "planning/cost_matrix.h"
#include "planning/path.h"
#include "planning/problem.h"

namespace joulecast::answers {

// How a robot drives where only the way is given: by the planner's profiles, or as it usually does.
enum class Driving { minimum_energy, usual };

inline constexpr double most_value_of_time_w = 1e6;

// A way from where the robot is.
struct Way {
  std::vector<planning::Segment> path;
  std::optional<planning::Stations> stations = {};  // the path fetches at one and brings to the other
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

}  // namespace joulecast::answers
