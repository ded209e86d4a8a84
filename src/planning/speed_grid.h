#pragma once

#include <cstddef>
#include <vector>

#include "planning/load.h"

namespace joulecast::planning {

// One run on a grid: which speed at which node costs least. Unknowns are the squared speeds z at the nodes;
// between nodes the acceleration q = (z1 - z0)/(2 step) is constant and loads are taken at the cell's middle.
struct SpeedGrid {
  std::vector<double> step;       // n cells
  std::vector<WheelLoads> loads;  // n, or 1 when the same everywhere
  std::vector<double> ceiling;    // n + 1 upper bounds of z
  double start = 0, end = 0;      // z at the ends
  double acceleration_limit = 0;  // of q; may be infinite
  double torque_limit_nm = 0;     // from the current limit
  double voltage_limit_v = 0;
  std::vector<double> motor_share;  // of the torque and voltage limits that a cell may use; empty: all
  Electric electric;

  double share(std::size_t cell) const { return motor_share.empty() ? 1 : motor_share[cell]; }
  std::size_t cells() const { return step.size(); }
  const WheelLoads& load(std::size_t cell) const { return loads.size() == 1 ? loads[0] : loads[cell]; }
};

// The fastest and the slowest profile that the limits allow. Where `fastest` falls below `slowest` there is
// none.
struct SpeedEnvelope {
  std::vector<double> fastest, slowest;
  double shortest_s = 0;  // duration of the fastest
  bool feasible = true;
  std::size_t broken_at = 0;  // node, when not feasible
};
SpeedEnvelope speed_envelope(const SpeedGrid& grid);

// The slowest profile whose acceleration stays within a bound; at rest in between where the way is long
// enough.
std::vector<double> slowest_profile(const SpeedGrid& grid, double acceleration);

// Mean speed over a cell of constant acceleration.
double mean_speed(double z0, double z1);

// Duration of a profile [s].
double duration_of(const SpeedGrid& grid, const std::vector<double>& z);

}  // namespace joulecast::planning
