#include "tests/study/exploration/dist_bug.h"

#include <gtest/gtest.h>

#include "random_map.h"
#include "tests/study/exploration/node_grid.h"

namespace joulecast::exploration {
namespace {

TEST(DistBug, AvoidsObstaclesAndReachesGoal) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> along(0, 20);
  int detours = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const Map map = random_map(random);
    const DistBug bug(map);
    const Point goal{along(random), along(random)};
    const auto path = bug.path(map.start, goal);
    if (bug.inside_grown(goal)) {
      EXPECT_FALSE(path);
      continue;
    }
    if (!path) continue;
    ASSERT_FALSE(path->empty());
    EXPECT_EQ(path->back(), goal);
    detours += path->size() > 1;
    Point from = map.start;
    for (const Point& to : *path) {
      for (int k = 0; k <= 500; ++k) EXPECT_FALSE(bug.inside_grown(from + (k / 500.0) * (to - from)));
      from = to;
    }
  }
  EXPECT_GT(detours, 40);
}

// Floods the nodes outside grown obstacles: DistBug must reach every node that the flood reaches.
TEST(DistBug, FindsEveryFloodReachableGoal) {
  std::mt19937_64 random(7);
  int reached = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const Map map = random_map(random);
    const DistBug bug(map);
    const NodeGrid grid(map);
    const std::size_t first = grid.nearest(map.start);
    if (grid.state(first) == NodeState::occupied || !bug.free(map.start, grid.position(first))) continue;
    std::vector<bool> wet(grid.size(), false);
    std::vector<std::size_t> front{first};
    wet[first] = true;
    for (std::size_t k = 0; k < front.size(); ++k) {
      grid.for_each_neighbour(front[k], [&](std::size_t n) {
        if (wet[n] || grid.state(n) == NodeState::occupied ||
            !bug.free(grid.position(front[k]), grid.position(n)))
          return;
        wet[n] = true;
        front.push_back(n);
      });
    }
    for (std::size_t k = 0; k < front.size(); k += 37) {
      EXPECT_TRUE(bug.path(map.start, grid.position(front[k]))) << trial;
      ++reached;
    }
  }
  EXPECT_GT(reached, 1000);
}

TEST(DistBug, TakesReachableCornerNearestGoal) {
  Map map;
  map.obstacles = {ConvexPolygon::square({10, 10}, 4)};
  const DistBug bug(map);
  // From below, the goal above and to the right: of the two lower corners the right one is nearer to it.
  const auto path = bug.path({10, 3}, {11, 18});
  ASSERT_TRUE(path);
  EXPECT_EQ(*path, (std::vector<Point>{{13, 7}, {13, 13}, {11, 18}}));
  EXPECT_EQ(*bug.path({10, 3}, {15, 3}), (std::vector<Point>{{15, 3}}));
}

TEST(DistBug, ReportsEnclosedGoals) {
  Map map;
  map.safety_radius_m = 0.5;
  map.obstacles = {*ConvexPolygon::from_corners({{9, 0}, {10, 0}, {10, 20}, {9, 20}})};
  const DistBug bug(map);
  EXPECT_FALSE(bug.path({5, 10}, {15, 10}));
  EXPECT_TRUE(bug.path({5, 10}, {5, 15}));
}

}  // namespace
}  // namespace joulecast::exploration
