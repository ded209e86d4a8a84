#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#include "planning/load.h"

namespace joulecast::planning {

// A wheel's load as grids keep it, since memory takes as long as arithmetic: the terms of a quadratic load
// that act alike are one.
struct CellLoad {
  double pace, inertia, f0, f1, f2;
  std::shared_ptr<const WheelLoad> full;  // unless it is quadratic

  WheelLoad whole() const {
    return full ? *full : WheelLoad{.pace = pace, .inertia = inertia, .f0 = f0, .f1 = f1, .f2 = f2};
  }
};
using CellLoads = std::array<CellLoad, 2>;
CellLoads in_cell(const WheelLoads& loads);

// One run on a grid: which speed at which node costs least. Unknowns are the squared speeds z at the nodes;
// between nodes the acceleration q = (z1 - z0)/(2 step) is constant and loads are taken at the cell's middle.
struct SpeedGrid {
  std::vector<double> step;      // n cells
  std::vector<CellLoads> loads;  // n, or 1 when the same everywhere
  std::vector<double> ceiling;   // n + 1 upper bounds of z
  double start = 0, end = 0;     // z at the ends
  // The least z between the ends, to which it rises from them with this acceleration at least.
  double floor = 0, floor_acceleration = 0;
  double acceleration_limit = 0;  // of q; may be infinite
  double torque_limit_nm = 0;     // from the current limit
  double voltage_limit_v = 0;
  // Of each cell just within its ends, where the motors' limits hold; empty: as in its middle.
  std::vector<std::array<CellLoads, 2>> end_loads;
  Electric electric;

  std::size_t cells() const { return step.size(); }
  const CellLoads& load(std::size_t cell) const { return loads.size() == 1 ? loads[0] : loads[cell]; }
  const CellLoads& load(std::size_t cell, std::size_t at_end) const {
    return end_loads.empty() ? load(cell) : end_loads[cell][at_end];
  }
};

// The most that a motor is used of its current and voltage limits at a speed and an acceleration: of those
// that less acceleration relieves, and of those that more does; of each limit.
struct MotorUse {
  double rising = 0, slowing = 0;
  double current = 0, voltage = 0;
  double uneven = 0;  // half the difference between the ends of a cell
  double most() const { return std::max(current, voltage); }
};
MotorUse motor_use(const SpeedGrid& grid, const CellLoads& loads, double v, double q);
// Within a cell, it lies between its values at the two ends: the greater of them.
MotorUse motor_use(const SpeedGrid& grid, std::size_t cell, double z0, double z1);

// Which limits of the motors speeds up to `v` within the acceleration limit could reach, by side and sign
// (positive, negative); of voltage, within the limit of torque.
struct Reachable {
  std::array<std::array<bool, 2>, 2> torque{}, voltage{};
  bool operator==(const Reachable&) const = default;
};
Reachable reachable(const SpeedGrid& grid, const CellLoads& loads, double v, double share = 1);

// The fastest and the slowest profile that the limits allow. Where `fastest` falls below `slowest` there is
// none.
struct SpeedEnvelope {
  std::vector<double> fastest, slowest;
  double shortest_s = 0;  // duration of the fastest
  bool feasible = true;
  std::size_t broken_at = 0;  // node, when not feasible
};
SpeedEnvelope speed_envelope(const SpeedGrid& grid);

// The fastest below a ceiling between the ends and with an acceleration within a bound.
std::vector<double> fastest_within(const SpeedGrid& grid, std::vector<double> ceiling, double acceleration);

// The least z of a grid with a floor, 0 without.
std::vector<double> floor_profile(const SpeedGrid& grid);

// The slowest profile with an acceleration within a bound; at rest in between where the way is long enough.
std::vector<double> slowest_profile(const SpeedGrid& grid, double acceleration);

// Mean speed over a cell of constant acceleration.
double mean_speed(double z0, double z1);

// Duration of a profile [s].
double duration_of(const SpeedGrid& grid, const std::vector<double>& z);

}  // namespace joulecast::planning
