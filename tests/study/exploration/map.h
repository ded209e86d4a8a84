#pragma once

#include <cstddef>
#include <vector>

#include "base/error.h"
#include "tests/study/exploration/geometry.h"

namespace joulecast::exploration {

// Bounds of the map of one exploration.
inline constexpr double max_side_m = 1000;
inline constexpr std::size_t max_nodes = 250'000;
inline constexpr std::size_t max_obstacles = 64;
inline constexpr std::size_t max_corners = 64;

// The ground to explore: x in [0, width], y in [0, height], the given obstacles, and the robot's position.
// The limits bound where nodes lie and where the robot's middle may go; they are no walls.
struct Map {
  double width_m = 20;
  double height_m = 20;
  // Thesis 5.4 calls 15 nodes "less than 0.2 %": more than 7,500 nodes, hence 0.2 m (10,201 nodes).
  double node_spacing_m = 0.2;
  double safety_radius_m = 1;
  std::size_t stop_unseen_nodes = 15;
  std::vector<ConvexPolygon> obstacles;
  Point start;
  double start_heading_rad = 0;
};

// Field names of errors are JSON pointers of the map file.
Result<void> validate(const Map& map);

inline constexpr int thesis_case_count = 5;

// Case 1 to 5 of thesis table 5-1: 20 m x 20 m with two squares of 4 m.
Result<Map> thesis_case(int number);

}  // namespace joulecast::exploration
