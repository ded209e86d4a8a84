#include "answers/drive.h"

#include <cmath>
#include <string_view>

namespace joulecast::answers {

Result<planning::Path> path_of(const Way& way, const planning::PathOptions& options) {
  Result<planning::Path> path = planning::make_path(way.path, options);
  if (path) return path;
  // make_path() names "/segments/3/...", which are the input's "/path/3/...".
  constexpr std::string_view given = "/segments";
  if (std::string& field = path.error().field; field.starts_with(given))
    field.replace(0, given.size(), "/path");
  return path;
}

bool is_brief(const std::vector<planning::Segment>& segments) {
  constexpr double short_arc_m = 20;  // 400 knots
  int motions = 0;
  for (const planning::Segment& segment : segments) {
    if (std::holds_alternative<planning::Dwell>(segment) ||
        std::holds_alternative<planning::PayloadChange>(segment))
      continue;
    const auto* arc = std::get_if<planning::Arc>(&segment);
    const bool simple = std::holds_alternative<planning::Straight>(segment) ||
                        std::holds_alternative<planning::TurnInPlace>(segment) ||
                        (arc != nullptr && arc->radius_m * std::fabs(arc->angle_rad) <= short_arc_m);
    if (!simple || ++motions > 1) return false;
  }
  return motions == 1;
}

}  // namespace joulecast::answers
