#pragma once

#include <vector>

#include "planning/path.h"
#include "planning/problem.h"

namespace joulecast::answers {

// How a robot drives where only the way is given: by the planner's profiles, or as it usually does.
enum class Driving { minimum_energy, usual };

inline constexpr double most_value_of_time_w = 1e6;

// A path and the way it is to be driven.
struct DriveInput {
  std::vector<planning::Segment> path;
  planning::PathOptions options;
  planning::Problem problem;
};

// Errors name "/path/<index>/<field>".
Result<planning::Path> path_of(const std::vector<planning::Segment>& segments,
                               const planning::PathOptions& options);

// True if the path will be a single run of few knots for any numbers: one straight, one turn in place or one
// short arc, with any dwells and changes of payload. Takes no time.
bool is_brief(const std::vector<planning::Segment>& segments);

}  // namespace joulecast::answers
