#include "tests/study/exploration/node_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "random_map.h"

namespace joulecast::exploration {
namespace {

// Walks along the ray in small steps.
bool seen_by_walking(const Map& map, Point eye, Point target, double& nearest_miss) {
  constexpr int steps = 4000;
  for (int k = 0; k <= steps; ++k) {
    const Point p = eye + (static_cast<double>(k) / steps) * (target - eye);
    for (const ConvexPolygon& o : map.obstacles) {
      if (o.contains(p)) return false;
      if (o.grown(0.01).contains(p)) nearest_miss = 0;
    }
  }
  return true;
}

TEST(NodeGrid, VisibilityAgreesWithRayWalking) {
  std::mt19937_64 random(3);
  int hidden = 0, shown = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const Map map = random_map(random);
    const NodeGrid grid(map);
    std::uniform_int_distribution<std::size_t> any(0, grid.size() - 1);
    for (int k = 0; k < 60; ++k) {
      const Point target = grid.position(any(random));
      double miss = 1;
      const bool walked = seen_by_walking(map, map.start, target, miss);
      if (!walked) {
        EXPECT_FALSE(grid.visible(map.start, target));
        ++hidden;
      } else if (miss > 0) {  // steps of 7 mm can jump over a sliver only where the ray grazes
        EXPECT_TRUE(grid.visible(map.start, target));
        ++shown;
      }
    }
  }
  EXPECT_GT(hidden, 50);
  EXPECT_GT(shown, 200);
}

TEST(NodeGrid, FourLooksShowAllVisible) {
  std::mt19937_64 random(4);
  for (int trial = 0; trial < 20; ++trial) {
    const Map map = random_map(random);
    NodeGrid grid(map);
    const NodeGrid before = grid;
    const std::size_t expected = grid.unseen_visible_from(map.start);
    std::size_t fresh = 0;
    for (int k = 0; k < 4; ++k)
      fresh += grid.look(map.start, map.start_heading_rad + k * std::numbers::pi / 2);
    EXPECT_EQ(fresh, expected);
    for (std::size_t n = 0; n < grid.size(); ++n) {
      if (before.state(n) == NodeState::occupied) {
        EXPECT_EQ(grid.state(n), NodeState::occupied);
      } else {
        EXPECT_EQ(grid.state(n) == NodeState::seen, grid.visible(map.start, grid.position(n)));
      }
    }
  }
}

TEST(NodeGrid, OneLookSpansNinetyDegrees) {
  Map map;
  map.start = {10, 10};
  NodeGrid grid(map);
  grid.look(map.start, 0);
  for (std::size_t n = 0; n < grid.size(); ++n) {
    const Point offset = grid.position(n) - map.start;
    const double bearing = std::fabs(std::atan2(offset.y_m, offset.x_m));
    if (length(offset) < 0.1 || std::fabs(bearing - std::numbers::pi / 4) < 1e-6) continue;
    EXPECT_EQ(grid.state(n) == NodeState::seen, bearing < std::numbers::pi / 4);
  }
}

TEST(NodeGrid, ThesisMapHasItsNodes) {
  const NodeGrid grid(*thesis_case(1));
  EXPECT_EQ(grid.columns(), 101u);
  EXPECT_EQ(grid.rows(), 101u);
  EXPECT_LT(15.0 / static_cast<double>(grid.size()), 0.002);
  // Strictly inside two squares of 6 m: 29 x 29 nodes each.
  EXPECT_EQ(grid.count(NodeState::occupied), 2u * 29 * 29);
}

TEST(NodeGrid, GroupsPartitionUnseenNodes) {
  std::mt19937_64 random(5);
  for (int trial = 0; trial < 20; ++trial) {
    const Map map = random_map(random);
    NodeGrid grid(map);
    for (int k = 0; k < 4; ++k) grid.look(map.start, k * std::numbers::pi / 2);
    const auto groups = grid.unseen_groups();
    std::vector<std::size_t> group_of(grid.size(), groups.size());
    std::size_t total = 0;
    for (std::size_t g = 0; g < groups.size(); ++g)
      for (const std::size_t n : groups[g]) group_of[n] = g, ++total;
    EXPECT_EQ(total, grid.count(NodeState::unseen));
    for (std::size_t n = 0; n < grid.size(); ++n) {
      if (grid.state(n) != NodeState::unseen) continue;
      grid.for_each_neighbour(n, [&](std::size_t m) {
        if (grid.state(m) == NodeState::unseen) {
          EXPECT_EQ(group_of[m], group_of[n]);
        }
      });
    }
  }
}

}  // namespace
}  // namespace joulecast::exploration
