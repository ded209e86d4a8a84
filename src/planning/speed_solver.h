#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "planning/load.h"
#include "planning/profile.h"

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

// Duration of a profile [s].
double duration_of(const SpeedGrid& grid, const std::vector<double>& z);

struct SpeedSolution {
  std::vector<double> z;
  double cost_j = 0;  // motors, idle power and price of time, of the grid's midpoint rule
  double gap_j = 0;   // see Certificate
  double residual = 0;
  double duration_s = 0;
  bool convex = true;  // the Hessian at the solution needed no correction and the whole region is convex
  bool converged = false;
  int iterations = 0;
  std::array<bool, bound_count> binding{};
};

// Minimises sum of step * [(idle + price)/v + sum over motors of phi(P/v)] by a primal-dual interior point
// method whose Newton matrix is tridiagonal: time and memory grow linearly with the cells. The kink of phi,
// where braking begins to regenerate, is smoothed with a width that goes to zero with the barrier, its slope
// being carried as a dual variable. Convex in z wherever the price of time outweighs viscous friction
// (thesis, minimum energy).
class SpeedSolver {
 public:
  SpeedSolver(const SpeedGrid& grid, const SpeedEnvelope& envelope);

  // `price_w` is added to the idle power. Starts from the last solution where there is one.
  SpeedSolution solve(double price_w, double tolerance = 1e-6);

  // Whether a current or voltage limit can bind anywhere.
  bool bounds_motors() const { return bounds_motors_; }

  // Starts the next solve from this profile; ignored unless strictly inside the bounds.
  void start_from(const std::vector<double>& z);

 private:
  static constexpr std::size_t most_bounds = 10;  // of a cell: 2 acceleration, 4 torque, 4 voltage

  struct Local {
    double f = 0, fv = 0, fq = 0, fvv = 0, fvq = 0, fqq = 0;
  };
  struct Cell {
    double v = 0, q = 0;
    std::array<double, 2> kink{};  // dual of phi's slope, in (-1, 1)
    std::array<double, most_bounds> multiplier{};
    std::array<double, most_bounds> slack{};
  };

  struct Torque {
    double t, tv, tq, tvv, tvq, tqq;
  };
  Torque torque(const WheelLoad& w, double v, double q) const;
  double cost(std::size_t cell, double v, double q) const;
  template <class Visit>
  void each_bound(std::size_t cell, double v, double q, Visit&& visit) const;
  double merit(const std::vector<double>& z, double mu) const;
  bool inside(const std::vector<double>& z) const;
  void set_point(const std::vector<double>& z);
  void assemble(double mu);
  bool factorise();
  void solve_step();

  const SpeedGrid& grid_;
  const SpeedEnvelope& envelope_;
  double idle_ = 0, smoothing_ = 0, gear_smoothing_ = 0;
  double mean_slope_ = 1, half_jump_ = 0;
  std::vector<std::uint16_t> bounds_;  // mask of bounds that can bind, per cell
  std::size_t bound_total_ = 0;
  std::vector<double> z_, trial_;
  std::vector<Cell> cells_;
  std::vector<double> ceiling_multiplier_, floor_multiplier_;
  std::vector<double> gradient_, stationarity_, diagonal_, off_, magnitude_, pivot_, lower_, step_;
  double cost_here_ = 0;  // at z_, smoothed
  double kink_gap_ = 0;   // how far the dual slopes bound phi from below [J]
  bool started_ = false, bounds_motors_ = false;
};

}  // namespace joulecast::planning
