#include "tests/study/exploration/explore.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>

#include "random_map.h"
#include "tests/study/exploration/exploration_json.h"

namespace joulecast::exploration {
namespace {

// The log against itself: counts, states and the pose after every motion.
void expect_consistent(const Map& map, const Exploration& e) {
  const DistBug bug(map);
  ASSERT_FALSE(e.rounds.empty());
  EXPECT_EQ(e.rounds.front().scan.at, map.start);
  EXPECT_EQ(e.unseen,
            static_cast<std::size_t>(std::count(e.nodes.begin(), e.nodes.end(), NodeState::unseen)));
  EXPECT_EQ(e.unseen, e.rounds.back().scan.unseen_after);
  EXPECT_EQ(e.outcome == Outcome::explored, e.unseen <= map.stop_unseen_nodes);
  EXPECT_FALSE(e.rounds.back().next);
  for (std::size_t k = 0; k + 1 < e.rounds.size(); ++k) {
    ASSERT_TRUE(e.rounds[k].next);
    const NextBestView& view = *e.rounds[k].next;
    const Candidate& winner = view.candidates[view.winner];
    EXPECT_EQ(e.rounds[k + 1].scan.at, winner.position);
    // The winner's count is that of the next scan, and no kept candidate had more.
    EXPECT_EQ(e.rounds[k].scan.unseen_after - e.rounds[k + 1].scan.unseen_after, winner.unseen_visible);
    EXPECT_GT(winner.unseen_visible, 0u);
    for (const Candidate& c : view.candidates) {
      EXPECT_LE(c.unseen_visible, winner.unseen_visible);
      EXPECT_GE(c.position.x_m, 0);
      EXPECT_LE(c.position.x_m, map.width_m);
      EXPECT_GE(c.position.y_m, 0);
      EXPECT_LE(c.position.y_m, map.height_m);
      if (c.fate == Candidate::Fate::occupied) {
        EXPECT_TRUE(bug.inside_grown(c.position));
      }
    }
  }
  Point at = map.start;
  double heading = map.start_heading_rad;
  for (const Motion& motion : e.motions) {
    if (const auto* turn = std::get_if<Turn>(&motion)) {
      heading += turn->angle_rad;
    } else {
      const auto& straight = std::get<Straight>(motion);
      EXPECT_EQ(straight.from, at);
      EXPECT_TRUE(bug.free(straight.from, straight.to));
      const double size = straight.length_m();
      EXPECT_NEAR(straight.to.x_m - at.x_m, size * std::cos(heading), 1e-7 * (1 + size));
      EXPECT_NEAR(straight.to.y_m - at.y_m, size * std::sin(heading), 1e-7 * (1 + size));
      at = straight.to;
    }
  }
  EXPECT_EQ(at, e.rounds.back().scan.at);
}

TEST(Explore, ExploresTheFiveCases) {
  for (int number = 1; number <= thesis_case_count; ++number) {
    SCOPED_TRACE(number);
    const Map map = *thesis_case(number);
    const auto e = explore(map);
    ASSERT_TRUE(e);
    EXPECT_EQ(e->outcome, Outcome::explored);
    EXPECT_LE(e->unseen, 15u);
    for (const Round& round : e->rounds)
      if (round.next) {
        EXPECT_FALSE(round.next->from_frontier);
      }
    expect_consistent(map, *e);
  }
}

TEST(Explore, ExploresFinerNodes) {
  for (int number = 1; number <= thesis_case_count; ++number) {
    for (const double spacing : {0.1, 0.25, 0.5, 1.0}) {
      SCOPED_TRACE(::testing::Message() << "case " << number << ", " << spacing << " m");
      Map map = *thesis_case(number);
      map.node_spacing_m = spacing;
      const auto e = explore(map);
      ASSERT_TRUE(e);
      EXPECT_LE(e->unseen, 15u);
      expect_consistent(map, *e);
    }
  }
}

TEST(Explore, IsDeterministicForAMap) {
  for (int number = 1; number <= thesis_case_count; ++number) {
    const Map map = *thesis_case(number);
    EXPECT_EQ(to_json(map, *explore(map), {}).dump(), to_json(map, *explore(map), {}).dump());
  }
}

TEST(Explore, ExploresRandomMaps) {
  std::mt19937_64 random(8);
  int explored = 0;
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE(trial);
    Map map = random_map(random);
    map.stop_unseen_nodes = 0;
    const auto e = explore(map);
    ASSERT_TRUE(e);
    expect_consistent(map, *e);
    explored += e->outcome == Outcome::explored;
  }
  EXPECT_GT(explored, 30);
}

TEST(Explore, EmptyGroundTakesOneLook) {
  Map map;
  map.start = {3, 4};
  const auto e = explore(map);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->rounds.size(), 1u);
  EXPECT_EQ(e->unseen, 0u);
  EXPECT_EQ(e->length_m(), 0);
  EXPECT_NEAR(e->turned_rad(), 2 * std::numbers::pi, 1e-12);
}

TEST(Explore, LeavesEnclosedGroundUnseen) {
  Map map;
  map.start = {5, 10};
  map.obstacles = {*ConvexPolygon::from_corners({{9, 0}, {10, 0}, {10, 20}, {9, 20}})};
  const auto e = explore(map);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->outcome, Outcome::stuck);
  EXPECT_GT(e->unseen, 15u);
  expect_consistent(map, *e);
}

}  // namespace
}  // namespace joulecast::exploration
