#include "tests/study/exploration/map.h"

#include <fmt/format.h>

#include <array>
#include <numbers>

namespace joulecast::exploration {
namespace {

Result<void> within(const char* field, double value, double low, double high, bool low_excluded) {
  if (std::isfinite(value) && (low_excluded ? value > low : value >= low) && value <= high) return {};
  return invalid(field, fmt::format("is {}, must be {} {} and at most {}", value,
                                    low_excluded ? "greater than" : "at least", low, high));
}

}  // namespace

Result<void> validate(const Map& map) {
  if (auto ok = within("/width_m", map.width_m, 0, max_side_m, true); !ok) return ok;
  if (auto ok = within("/height_m", map.height_m, 0, max_side_m, true); !ok) return ok;
  if (auto ok = within("/node_spacing_m", map.node_spacing_m, 0, std::min(map.width_m, map.height_m), true);
      !ok)
    return ok;
  const double nodes = (std::floor(map.width_m / map.node_spacing_m) + 1) *
                       (std::floor(map.height_m / map.node_spacing_m) + 1);
  if (nodes > static_cast<double>(max_nodes)) {
    return fail(Fault::too_large, "/node_spacing_m",
                fmt::format("is {} m and makes {:.0f} nodes, must make at most {}", map.node_spacing_m, nodes,
                            max_nodes));
  }
  if (auto ok = within("/safety_radius_m", map.safety_radius_m, 0, max_side_m, false); !ok) return ok;
  if (map.obstacles.size() > max_obstacles) {
    return fail(Fault::too_large, "/obstacles",
                fmt::format("has {} members, must have at most {}", map.obstacles.size(), max_obstacles));
  }
  if (auto ok = within("/robot/x_m", map.start.x_m, 0, map.width_m, false); !ok) return ok;
  if (auto ok = within("/robot/y_m", map.start.y_m, 0, map.height_m, false); !ok) return ok;
  if (!std::isfinite(map.start_heading_rad)) return invalid("/robot/heading_rad", "must be finite");
  for (std::size_t k = 0; k < map.obstacles.size(); ++k) {
    if (map.obstacles[k].grown(map.safety_radius_m).contains(map.start)) {
      return invalid("/robot", fmt::format("stands nearer to obstacle {} than its safety radius of {} m", k,
                                           map.safety_radius_m));
    }
  }
  return {};
}

Result<Map> thesis_case(int number) {
  struct Row {
    Point robot, obstacle1, obstacle2;
    double heading_rad;
  };
  using std::numbers::pi;
  static constexpr std::array<Row, thesis_case_count> table_5_1{{
      {{10, 3}, {15, 5}, {7, 10}, pi / 4},
      {{10, 3}, {5, 15}, {7, 10}, pi / 4},
      {{10, 10}, {5, 10}, {15, 12}, pi / 2},
      {{10, 10}, {5, 5}, {15, 6}, pi / 2},
      {{5, 16}, {12, 11}, {15, 6}, pi},
  }};
  if (number < 1 || number > thesis_case_count) {
    return invalid("case", fmt::format("is {}, must be 1 to {}", number, thesis_case_count));
  }
  const Row& row = table_5_1[static_cast<std::size_t>(number - 1)];
  Map map;
  map.obstacles = {ConvexPolygon::square(row.obstacle1, 4), ConvexPolygon::square(row.obstacle2, 4)};
  map.start = row.robot;
  map.start_heading_rad = row.heading_rad;
  return map;
}

}  // namespace joulecast::exploration
