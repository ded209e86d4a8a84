#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "planning/load.h"
#include "planning/problem.h"

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

struct SpeedSolution {
  std::vector<double> z;
  double price_w = 0;
  double cost_j = 0;  // motors, idle power and price of time, of the grid's midpoint rule
  double gap_j = 0;   // see Certificate
  // For each cell, the cost of enforcing motors' limits at its ends: at constant acceleration a motor is used
  // fully at one end only. Their multipliers times half the difference between the ends; it falls with the
  // cell's length. Empty where no motor's limit can bind.
  std::vector<double> ends_j;
  double residual = 0;
  double duration_s = 0;
  bool convex = true;  // the Hessian at the solution needed no correction and the whole region is convex
  bool converged = false;
  int iterations = 0;
  std::array<bool, bound_count> binding{};

  bool stationary() const { return residual < 5e-3; }  // relative to the cost
};

// The duration of a profile whose price of time is to be found, and the highest such price.
struct Due {
  double duration_s = 0, most_w = 0;
};

// Minimises sum of step * [(idle + price)/v + sum over motors of phi(P/v)] by a primal-dual interior point
// method with a tridiagonal Newton matrix: time and memory grow linearly with the cells. The kink of phi,
// where braking begins to regenerate, is smoothed with a width that goes to zero with the barrier, its slope
// being carried as a dual variable. Convex in z wherever the price of time outweighs viscous friction
// (thesis, minimum energy).
class SpeedSolver {
 public:
  explicit SpeedSolver(SpeedGrid grid);

  const SpeedGrid& grid() const { return grid_; }
  const SpeedEnvelope& envelope();

  // `price_w` is added to the idle power. Starts on the way that the last solve took where there was one, the
  // earlier the more the price has changed. With `due` the price is the first guess of one that is solved for
  // together with the profile; not converged where it is dearer than allowed. Where scrub makes the problem
  // not convex, a first solve also starts slow and fast, and takes the cheapest result. Not converged when a
  // stop is requested; the profile, if any, is feasible.
  SpeedSolution solve(double price_w, double tolerance = 1e-6, const std::stop_token& stop = {},
                      const std::optional<Due>& due = {});

  // Cost of a profile by the grid's midpoint rule, of each cell.
  std::vector<double> costs_j(const std::vector<double>& z, double price_w);

  // Starts the next solve from this profile, a little slower so that it is strictly inside the bounds;
  // ignored where that does not make it so.
  void start_from(const std::vector<double>& z);

 private:
  struct Local {
    double f = 0, fv = 0, fq = 0, fvv = 0, fvq = 0, fqq = 0;
    double dual_v = 0, dual_q = 0;  // slopes with the kink's dual in place of its own
  };
  // A motor's energy over the way of a cell, and its derivatives.
  struct Energy {
    double j = 0, by_v = 0, by_q = 0;
    double steepness = 0;  // of the smoothed kink: the inverse of its |j|
  };
  struct Cell {
    double v = 0, q = 0, by_z0 = 0, by_z1 = 0;  // by...: derivatives of v
    std::array<double, 2> kink{};               // dual of phi's slope, in (-1, 1)
    std::array<Energy, 2> energy{};
  };
  // A bound of a cell: 2 of acceleration, 2 of the speed at its first node; at either end 4 of torque, 4 of
  // voltage.
  struct BoundState {
    double multiplier = 0, slack = 0;
    double share0 = 0, share1 = 0;  // of the slack, that z0 and z1 use up for each unit
    double raised = 0;              // above mu, that multiplier times slack is led to
    unsigned index = 0;

    double used(double dz0, double dz1) const { return share0 * dz0 + share1 * dz1; }
  };

  // The barrier parameter mu, and the widths that smoothing has at it.
  class BarrierSchedule {
   public:
    // Begins at that gap, a share of the cost.
    BarrierSchedule(const SpeedGrid& grid, double bounds, double cost_j, double tolerance, double gap);
    double mu() const { return mu_; }
    double gap() const { return mu_ * bounds_ / scale_; }
    double scale() const { return scale_; }  // the cost that tolerances are shares of
    bool at_finest() const { return mu_ <= finest_; }
    void follow(double cost_j);
    void lower(double decrement, double step_length);
    double kink_width() const;    // of the energy over the way [J/x]
    double torque_width() const;  // [N m]

   private:
    double tolerance_, bounds_, scale_, length_ = 0, torque_nm_ = 0, mu_ = 0, finest_ = 0;
  };

  struct Node {
    explicit Node(double squared) : z(squared), v(std::sqrt(squared)), pace(squared > 0 ? 1 / v : 0) {}
    double z, v, pace;  // the inverse of v, 0 at rest
  };
  struct Torque {
    double t, tv, tq, tvv, tvq, tqq;
  };
  Torque torque_in_full(const WheelLoad& w, double v, double q) const;
  Torque torque(const CellLoad& w, double v, double q) const;
  double smooth_size(double torque_nm) const {  // |torque|, smooth at zero
    return std::sqrt(torque_nm * torque_nm + torque_smoothing_ * torque_smoothing_);
  }
  std::span<BoundState> bounds_of(std::size_t cell) {
    return {bound_states_.data() + first_bound_[cell], bound_states_.data() + first_bound_[cell + 1]};
  }
  template <class Visit>
  void each_bound(std::size_t cell, const Node& first, const Node& last, Visit&& visit) const;
  std::vector<double> initial_point(std::optional<double> share = {});
  void set_return(double down);
  void finish(SpeedSolution& solution, double price_w);
  SpeedSolution descend(double price_w, double gap, double tolerance, const std::stop_token& stop,
                        const std::optional<Due>& due);
  void start_duals(double mu);
  Local local(std::size_t cell);
  bool assemble(const std::vector<double>& z);
  double merit(double mu) const { return cost_ - mu * logarithms_; }
  bool factorise(double share);
  bool regularise(double damping, bool& corrected);
  void solve_step(const std::vector<double>& slope, std::vector<double>& step) const;
  double follow_price(double due_s);
  std::vector<double> cost_of_ends();
  double stationarity_residual() const;
  double step_to_boundary();
  double decrement() const;
  double centre(double mu);
  double line_search(double longest, double decrement, BarrierSchedule& barrier);
  void smooth(const BarrierSchedule& b) { smoothing_ = b.kink_width(), torque_smoothing_ = b.torque_width(); }
  void update_duals(double mu);
  void restore_duals();
  std::array<bool, bound_count> binding(double unit_j) const;

  const SpeedGrid grid_;
  std::optional<SpeedEnvelope> envelope_;  // once asked for
  std::vector<double> floor_;              // of z
  double idle_ = 0, smoothing_ = 0, torque_smoothing_ = 0;
  double mean_slope_ = 1, half_jump_ = 0;
  std::vector<std::uint32_t> bounds_;     // mask of bounds that can bind, per cell
  std::vector<std::size_t> first_bound_;  // of each cell in the following
  std::vector<BoundState> bound_states_;
  std::vector<std::pair<BoundState*, double>> raised_;
  // Of the last solve: a profile for each barrier that was about solved, and its gap.
  struct Passed {
    double gap;
    std::vector<double> z;
  };
  std::vector<Passed> way_;
  double last_idle_ = 0;
  std::vector<double> z_, trial_;
  std::vector<Cell> cells_;
  // Of the profile that was assembled last: derivatives of the cost, of the sum of logarithms, of the
  // Lagrangian, and its Hessian with the bounds condensed.
  std::vector<double> by_z_, push_, stationarity_, diagonal_, off_, magnitude_;
  double cost_ = 0, logarithms_ = 0;  // smoothed; sum of those of the slacks
  double products_ = 0;               // sum of multipliers times slacks
  double kink_gap_ = 0;               // how far the dual slopes bound phi from below [J]
  std::vector<double> gradient_, slope_, by_price_, pivot_, lower_, step_;
  std::vector<double> duals_;  // multipliers and kinks' slopes where the step begins
  bool started_ = false, bounds_motors_ = false, scrubs_ = false;  // started_: z_ is a profile that was given
};

}  // namespace joulecast::planning
