#include "answers/floor_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace joulecast::answers {
namespace {

using history::FloorMission;
using history::FloorReading;
using history::FloorVisit;

// A robot that crosses every square of a floor of 12 by 8 cells of 2 m in each mission.
struct Fleet {
  std::mt19937 random{7};
  double scatter = 0.1;  // of a square's energy
  FloorMapper mapper{2.0};
  int missions = 0;

  template <class Ratio>
  void drive(const std::string& robot, int count, Ratio ratio) {
    std::normal_distribution<double> noise(0, scatter);
    for (int k = 0; k < count; ++k) {
      std::vector<FloorVisit> visits;
      for (std::int32_t column = -4; column < 8; ++column)
        for (std::int32_t row = 0; row < 8; ++row) {
          const double modelled_j = 80 + 40 * std::fabs(noise(random));
          const double measured_j = modelled_j * (ratio(column, row) + noise(random));
          visits.push_back({{4, 2, measured_j, measured_j, measured_j, modelled_j}, column, row});
        }
      EXPECT_TRUE(mapper.add(FloorMission{++missions, robot, visits}));
    }
  }

  FloorMap map() { return *mapper.finish(FloorReading{missions, missions, missions * 384}); }
};

std::vector<FloorCell> standing_out(const FloorMap& map) {
  std::vector<FloorCell> cells;
  for (const FloorCell& cell : map.cells)
    if (cell.stands_out) cells.push_back(cell);
  return cells;
}

TEST(FloorMap, FindsZonesAboveTheModel) {
  Fleet fleet;
  const auto carpet = [](std::int32_t column, std::int32_t row) {
    return column >= 2 && column <= 3 && row >= 4 && row <= 6 ? 1.3 : 1.0;
  };
  fleet.drive("a", 20, carpet);
  fleet.drive("b", 20, carpet);
  const FloorMap map = fleet.map();
  ASSERT_EQ(map.zones.size(), 1u);
  const FloorZone& zone = map.zones.front();
  EXPECT_EQ(zone.cells, 6);
  EXPECT_EQ(zone.x_min_m, 4);
  EXPECT_EQ(zone.x_max_m, 8);
  EXPECT_EQ(zone.y_min_m, 8);
  EXPECT_EQ(zone.y_max_m, 14);
  EXPECT_NEAR(zone.departure, 0.3, 0.03);
  EXPECT_NEAR(zone.excess_j, 0.3 * 83 * 6 * 40, 0.12 * 0.3 * 83 * 6 * 40);
  EXPECT_EQ(standing_out(map).size(), 6u);
  for (const FloorCell& cell : map.cells) {
    EXPECT_EQ(cell.missions, 40);
    EXPECT_EQ(cell.robots, 2);
    EXPECT_NEAR(cell.energy_per_distance_j_m(map.cell_m), cell.measured_j / 80, 1e-9);
  }
  EXPECT_EQ(map.robots, (std::vector<std::string>{"a", "b"}));
}

TEST(FloorMap, UniformErrorMarksNoZone) {
  Fleet fleet;
  fleet.drive("worn", 15, [](std::int32_t, std::int32_t) { return 1.4; });
  fleet.drive("right", 15, [](std::int32_t, std::int32_t) { return 1.0; });
  const FloorMap map = fleet.map();
  EXPECT_TRUE(map.zones.empty());
  EXPECT_NEAR(map.measured_j / map.modelled_j, 1.2, 0.02);
}

// Each square marked without cause is a false alarm: at most one map in twenty has any.
TEST(FloorMap, ChanceRarelyMarksZones) {
  int alarms = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Fleet fleet;
    fleet.random.seed(seed);
    fleet.scatter = 0.3;
    fleet.drive("a", 12, [](std::int32_t, std::int32_t) { return 1.0; });
    alarms += !fleet.map().zones.empty();
  }
  EXPECT_LE(alarms, 5);
}

TEST(FloorMap, IntervalsHaveNominalCoverage) {
  int held = 0, all = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Fleet fleet;
    fleet.random.seed(seed);
    fleet.drive("a", 20, [](std::int32_t, std::int32_t) { return 1.0; });
    for (const FloorCell& cell : fleet.map().cells) {
      held += cell.interval[0] <= 0 && cell.interval[1] >= 0;
      ++all;
    }
  }
  EXPECT_NEAR(held / static_cast<double>(all), 0.95, 0.03);
}

TEST(FloorMap, OmitsCellsWithFewMissions) {
  Fleet fleet;
  fleet.scatter = 0;
  fleet.drive("a", 4, [](std::int32_t column, std::int32_t) { return column == 0 ? 2.0 : 1.0; });
  for (const FloorCell& cell : fleet.map().cells) {
    EXPECT_TRUE(std::isnan(cell.departure));
    EXPECT_FALSE(cell.stands_out);
  }
}

TEST(FloorMap, SeparatesExcessAndDeficitZones) {
  Fleet fleet;
  fleet.drive("a", 30, [](std::int32_t column, std::int32_t row) {
    return row != 3 ? 1.0 : column == 0 ? 1.5 : column == 1 ? 0.6 : 1.0;
  });
  const FloorMap map = fleet.map();
  ASSERT_EQ(map.zones.size(), 2u);
  EXPECT_GT(map.zones[0].departure, 0.4);
  EXPECT_LT(map.zones[1].departure, -0.3);
}

TEST(FloorMap, StandingHasNoEnergyPerMetre) {
  FloorMapper mapper(1);
  const std::vector<FloorVisit> visits{{{100, 0.2, 2000, 20, 0, 0}, 0, 0}, {{2, 1.1, 90, 90, 0, 0}, 1, 0}};
  EXPECT_TRUE(mapper.add(FloorMission{1, "a", visits}));
  const FloorMap map = *mapper.finish({1, 1, 102});
  ASSERT_EQ(map.cells.size(), 2u);
  EXPECT_EQ(map.cells[0].covered_s, 100) << "the longest visited first";
  EXPECT_TRUE(std::isnan(map.cells[0].energy_per_distance_j_m(1)));
  EXPECT_NEAR(map.cells[1].energy_per_distance_j_m(1), 90 / 1.1, 1e-9);
}

TEST(FloorMap, RejectsTooManySquares) {
  FloorMapper mapper(0.1);
  std::vector<FloorVisit> visits;
  for (std::int32_t k = 0; k <= static_cast<std::int32_t>(most_floor_cells); ++k)
    visits.push_back({{1, 1, 1, 0, 1, 1}, k, 0});
  EXPECT_FALSE(mapper.add(FloorMission{1, "a", visits}));
  const auto map = mapper.finish({});
  ASSERT_FALSE(map);
  EXPECT_EQ(map.error().field, "cell_m");
}

}  // namespace
}  // namespace joulecast::answers
