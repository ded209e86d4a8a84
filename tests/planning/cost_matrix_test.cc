#include "planning/cost_matrix.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "planning/cost_table.h"
#include "planning/planner.h"
#include "tests/planning/robots.h"

namespace joulecast::planning {
namespace {

// Lengths and payloads at random, none of them nodes: tabled costs stay within the table's own error of the
// planner's.
TEST(CostTable, KeepsItsStatedError) {
  std::mt19937_64 random(3);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  for (robot::RobotModel robot : test::all_robots()) {
    for (const double value_of_time : {0.0, 50.0}) {
      const auto table = CostTable::make(robot, {.value_of_time_w = value_of_time, .regeneration = {}});
      ASSERT_TRUE(table) << describe(table.error());
      EXPECT_LT(table->interpolation_error(), 2e-3);
      const auto planner = Planner::make(robot);
      ASSERT_TRUE(planner);
      Problem problem;
      problem.limits = limits_of(robot);
      problem.value_of_time_w = value_of_time;
      for (int k = 0; k < 40; ++k) {
        const double payload = k % 3 ? between(0, robot.limits.payload_kg) : 0;
        const bool driving = k % 2 == 0;
        const double length = std::exp(between(std::log(0.01), std::log(driving ? 3000.0 : 10.0)));
        const auto path = make_path(
            std::vector<Segment>{driving ? Segment(Straight{length}) : Segment(TurnInPlace{-length})},
            PathOptions{.start = {}, .payload_kg = payload});
        const auto exact = planner->cost(*path, problem);
        ASSERT_TRUE(exact) << describe(exact.error());
        const LegCost ours = driving ? table->straight(length, payload) : table->turn(-length, payload);
        // Midway between nodes the error is largest but for kinks, which may fall nearer to a node.
        const double bound = 2 * table->interpolation_error() + 2e-5;
        EXPECT_NEAR(ours.energy_j, exact->energy_j, bound * exact->energy_j)
            << robot.robot_id << " " << length << " " << payload;
        EXPECT_NEAR(ours.duration_s, exact->duration_s, bound * exact->duration_s);
      }
    }
  }
}

TEST(CostTable, ReportsNeglectedEffectsOfPlaces) {
  robot::RobotModel robot = test::amr();
  const auto plain = CostTable::make(robot, {});
  robot.effects.push_back({"slope", {{"angle_rad", 0.02}, {"uphill_rad", 0}}});
  const auto sloped = CostTable::make(robot, {});
  ASSERT_TRUE(plain && sloped);
  EXPECT_TRUE(plain->neglected().empty());
  ASSERT_EQ(sloped->neglected(), std::vector<std::string>{"slope"});
  EXPECT_EQ(plain->straight(3, 10).energy_j, sloped->straight(3, 10).energy_j);
}

TEST(CostTableCache, EqualDrivesShareTables) {
  CostTableCache cache(2);
  robot::RobotModel a = test::nomad(), b = test::nomad();
  b.robot_id = "another";
  b.battery.capacity_ah = 99;
  const auto first = cache.get(a, {}), second = cache.get(b, {});
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->get(), second->get());
  b.motor.viscous_friction_nm_s_rad *= 2;
  const auto third = cache.get(b, {});
  EXPECT_NE(third->get(), first->get());
  EXPECT_NE(cache.get(a, {.value_of_time_w = 3, .regeneration = {}})->get(), first->get());
  EXPECT_EQ(cache.size(), 2u);
}

// A cell equals the planner's answer for the same errand driven as one path.
TEST(CostMatrix, CellsArePlans) {
  const auto table = [](const robot::RobotModel& r) {
    return std::make_shared<const CostTable>(*CostTable::make(r, {}));
  };
  const std::vector<robot::RobotModel> models = {test::amr(), test::tug()};
  std::vector<MatrixRobot> robots;
  const Pose stand{1, -2, 0.4};
  for (const auto& model : models) robots.push_back({table(model), model.limits.payload_kg, stand});
  MatrixTask errand;
  errand.payload_kg = 35;
  errand.stations.pickup = Station{6, 3, {}};
  errand.stations.dropoff = Station{-4, 5, 2.0};
  errand.stations.pickup_dwell_s = 20;
  errand.stations.dropoff_dwell_s = 5;
  MatrixTask heavy = errand;
  heavy.payload_kg = 100;  // the tug's, not the AMR's
  MatrixTask legs;
  legs.payload_kg = 20;
  legs.empty = {Leg{{Motion::drive, 4}, {Motion::drive, 2}, {Motion::turn, 1.2}}, Leg{{Motion::drive, 8}}};
  legs.loaded = Leg{{Motion::drive, 3}, {Motion::turn, 0.5}, {Motion::turn, 0.7}};
  const std::vector<Segment> bends = {Straight{3}, Arc{2, 1.2}, Dwell{4}, TurnInPlace{-0.5}, Straight{3}};
  MatrixTask curves = legs;
  curves.empty = {leg_of(*make_path(bends))};
  const CostMatrix matrix(robots, {errand, heavy, legs, curves});
  for (std::size_t r = 0; r < models.size(); ++r) {
    std::vector<Cell> cells;
    matrix.row(r, cells);
    ASSERT_EQ(cells.size(), 4u);
    Problem problem;
    problem.limits = limits_of(models[r]);
    const auto check = [&](const Cell& cell, std::vector<Segment> before,
                           const std::vector<Segment>& loaded) {
      before.insert(before.end(), loaded.begin(), loaded.end());
      const auto path = make_path(before, PathOptions{.start = stand});
      ASSERT_TRUE(path) << describe(path.error());
      const auto exact = plan(models[r], *path, problem);
      ASSERT_TRUE(exact) << describe(exact.error());
      EXPECT_EQ(cell.obstacle, Obstacle::none);
      EXPECT_NEAR(cell.energy_j, exact->summary.energy_j, 2e-3 * exact->summary.energy_j);
      EXPECT_NEAR(cell.duration_s, exact->summary.duration_s, 2e-3 * exact->summary.duration_s);
    };
    check(cells[0], {Polyline{{{6, 3}}}, Dwell{20}}, {PayloadChange{35}, Polyline{{{-4, 5}}, 2.0}, Dwell{5}});
    const std::vector<Segment> loaded = {PayloadChange{20}, TurnInPlace{-0.5}, Straight{3}, TurnInPlace{0.7}};
    check(cells[3], bends, loaded);
    if (r == 0) {
      EXPECT_EQ(cells[1].obstacle, Obstacle::payload);
      EXPECT_TRUE(std::isnan(cells[1].energy_j));
      check(cells[2], {Straight{4}, TurnInPlace{1.2}, Straight{2}}, loaded);
    } else {
      EXPECT_GT(cells[1].energy_j, cells[0].energy_j);
      check(cells[2], {Straight{8}}, loaded);
    }
  }
}

TEST(CostMatrix, ReportsLimitsWithoutMotion) {
  robot::RobotModel weak = test::amr();
  weak.limits.current_a = 0.1;
  robot::RobotModel high_ohmic = test::amr();
  high_ohmic.motor.resistance_ohm = 500;
  // Moves some of the payload that it may carry.
  robot::RobotModel rolling = test::amr();
  rolling.limits.current_a = 1;
  rolling.effects.push_back({"load_rolling_resistance", {{"coefficient", 0.02}}});
  std::vector<MatrixTask> tasks(3);
  for (const std::size_t t : {0u, 1u, 2u}) {
    tasks[t].payload_kg = 30 * static_cast<double>(t);
    tasks[t].empty = {Leg{{Motion::drive, 4}}};
    tasks[t].loaded = Leg{{Motion::drive, 4}, {Motion::turn, 1}};
  }
  for (const robot::RobotModel& robot : {weak, high_ohmic, rolling}) {
    const auto table = CostTable::make(robot, {});
    ASSERT_TRUE(table) << describe(table.error());
    ASSERT_TRUE(table->obstacle());
    const CostMatrix matrix({{std::make_shared<const CostTable>(*table), 60, {}}}, tasks);
    std::vector<Cell> cells;
    matrix.row(0, cells);
    for (const std::size_t t : {0u, 1u, 2u}) {
      const bool moves = !robot.effects.empty() && t < 2;
      EXPECT_EQ(cells[t].obstacle, moves ? Obstacle::none : Obstacle::limits) << t;
      EXPECT_EQ(std::isfinite(cells[t].energy_j), moves) << t;
    }
  }
}

}  // namespace
}  // namespace joulecast::planning
