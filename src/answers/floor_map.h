#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/store.h"
#include "signals/sample.h"

// Where on the floor a fleet spends its energy, and where its consumption differs from its models.
//
// Each mission is its own standard: the energy in a square is compared with the energy by the mission's model
// times the mission's usual ratio of measured to modelled energy, the median over its squares weighted by
// modelled energy. A model or a sensor with the same error everywhere thus does not mark the floor. The
// departure of a square is the ratio estimator of all missions' excess over that expectation, its error that
// of the ratio estimator with missions as the units (Cochran, Sampling Techniques, 2.11 and 6.4).
//
// The cause of a departure need not be the floor: a place where all robots turn, brake or climb shows the
// models' errors of turning, braking and climbing.
namespace joulecast::answers {

inline constexpr std::int64_t least_floor_missions = 5;  // for a departure
inline constexpr double least_floor_departure = 0.05;    // that may be marked
inline constexpr std::size_t most_floor_cells = 200'000;

struct FloorCell : history::FloorSums {
  double x_m = 0, y_m = 0;  // the corner of least coordinates
  std::int64_t missions = 0;
  std::int64_t robots = 0;
  // Excess over the expected energy, as a share of it, with its 95 % interval; NaN: too few missions.
  double departure = signals::unmeasured;
  std::array<double, 2> interval{signals::unmeasured, signals::unmeasured};
  // Departs by least_floor_departure, and by more than chance makes of all squares together (5 %).
  bool stands_out = false;

  // Of driving, J/m; NaN where robots stand.
  double energy_per_distance_j_m(double cell_m) const;
};

// Squares that touch, by a side or a corner, and depart in the same direction.
struct FloorZone {
  double x_min_m = 0, y_min_m = 0, x_max_m = 0, y_max_m = 0;
  std::int64_t cells = 0;
  double covered_s = 0;
  double distance_m = 0;
  double departure = 0;
  double excess_j = 0;  // over the expected energy
};

struct FloorMap : history::FloorSums {
  double cell_m = 0;
  history::FloorReading reading;
  std::vector<std::string> robots;
  std::vector<FloorCell> cells;  // the longest visited first
  std::vector<FloorZone> zones;  // the greatest excess first, of either sign
};

// Sums missions up.
class FloorMapper {
 public:
  explicit FloorMapper(double cell_m) : cell_m_(cell_m) {}

  // False once there are more than most_floor_cells squares.
  bool add(const history::FloorMission& mission);
  // Fault::invalid on "cell_m" for more than most_floor_cells squares.
  Result<FloorMap> finish(const history::FloorReading& reading) const;

 private:
  // Of the missions that measured: the excess over the expected energy, and the expected energy, J.
  struct Departure {
    std::int64_t missions = 0;
    double excess_j = 0, expected_j = 0;
    double excess2 = 0, product = 0, expected2 = 0;
    void add(double excess_j, double expected_j);
  };
  struct Square {
    FloorCell cell;
    std::set<std::size_t> robots;
    Departure departure;
  };
  using Place = std::pair<std::int32_t, std::int32_t>;

  static void judge(std::vector<std::pair<Place, const Departure*>>& of, std::map<Place, FloorCell>& cells);
  std::vector<FloorZone> zones(const std::map<Place, FloorCell>& cells) const;

  double cell_m_;
  std::map<Place, Square> squares_;
  std::map<std::string, std::size_t, std::less<>> robots_;
};

}  // namespace joulecast::answers
