#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

#include "history/records.h"

namespace joulecast::history {

inline constexpr std::int64_t max_floor_points = 1'000'000;  // seconds of missions
inline constexpr double least_floor_cell_m = 0.1;
inline constexpr double greatest_floor_cell_m = 100;
// No robot has positions beyond this.
inline constexpr double farthest_floor_m = 1e6;
// A robot that is slower, on average over a second, stands or turns in place: its energy is not the floor's.
// With 0.02 and 0.1 m/s the energy over distance of a virtual AMR is 2 % more and 4 % less.
inline constexpr double least_floor_speed_m_s = 0.05;

// A mission's sums within one square of the floor, [column, column + 1) x [row, row + 1) cells from the
// origin of its robot's map, from the mission's trace: a second belongs to the square of its mean position.
struct FloorVisit {
  std::int32_t column = 0, row = 0;
  double covered_s = 0;
  double distance_m = 0;  // sum of the absolute mean speeds of the seconds
  double energy_j = 0;    // measured, or modelled where it was not
  // Over the seconds of driving in which both are available.
  double measured_j = 0;
  double modelled_j = 0;
  double driving_j = 0;  // of energy_j
};

struct FloorMission {
  MissionKey key = 0;
  std::string_view robot_id;
  std::span<const FloorVisit> visits;  // each square at most once, in no order
};

// The extent of a reading. Annulled and contradicted missions do not count.
struct FloorReading {
  std::int64_t missions = 0;       // that match
  std::int64_t missions_read = 0;  // all of them, or an even share where they last longer than was allowed
  std::int64_t points = 0;         // seconds read
};

// Takes one mission after the other; false ends the reading.
using FloorSink = std::function<bool(const FloorMission&)>;

}  // namespace joulecast::history
