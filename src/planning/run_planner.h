#pragma once

#include <algorithm>
#include <memory>
#include <numeric>
#include <optional>
#include <stop_token>
#include <vector>

#include "planning/line.h"
#include "planning/load.h"
#include "planning/path.h"
#include "planning/problem.h"
#include "planning/speed_solver.h"
#include "planning/uniform_motion.h"

namespace joulecast::planning {

// The optimum of one run at one price of time.
struct RunAnswer {
  Method method = Method::closed_form;
  std::unique_ptr<LineMotion> line;  // closed form, over the run's coordinate
  std::vector<double> way, speed;    // else nodes of it, the acceleration being constant in between
  double price_w = 0;
  double energy_j = 0;  // on the solver's own quadrature, idle power included
  double duration_s = 0;
  double gap_j = 0, discretisation_j = 0, residual = 0;
  bool convex = true;
  int iterations = 0;
  std::array<bool, bound_count> binding{};

  double peak_speed = 0;  // along the run's coordinate

  bool has_motion() const { return line || !way.empty(); }
  void forget_motion();
};

tl::unexpected<Error> stopped();

// Solves one run for any price of time; keeps its grid and last solution between calls.
class RunPlanner {
 public:
  // `uniform`: the run's DriveLoads::uniform_loads(). Errors are Planner's.
  static Result<RunPlanner> make(const robot::RobotModel& robot, const DriveLoads& loads, const Run& run,
                                 const std::optional<WheelLoads>& uniform, const Problem& problem,
                                 double start_speed, double end_speed);

  // At an infinite price as fast as the limits allow, in shortest_s(); infeasible where none bounds the
  // acceleration. On a grid, `due` makes the price a first guess.
  Result<RunAnswer> solve(double price_w, const std::stop_token& stop = {},
                          const std::optional<Due>& due = {});
  // The same on a first grid, which errs by some thousandths: near enough to search for a price of time.
  Result<RunAnswer> solve_roughly(double price_w, const std::stop_token& stop = {});
  // Where the closed form answers.
  std::optional<RunAnswer> closed_form(double price_w) const;

  // Of a uniform run from rest to rest, of the resulting length, in free time: the motion that turns at
  // `peak`, up to the speed at which long ways are driven. Empty where neither the closed form nor the
  // quadrature applies.
  std::optional<RestMotion> to_peak(double peak, double price_w);
  std::optional<double> cruise_speed(double price_w);
  // At that steady speed.
  double steady_power_w(double speed) const;

  const Run& run() const { return *run_; }
  // Whether the motions of this run are also those of `other` between these speeds: both have constant loads,
  // equal lengths and limits, and equal loads of the wheels or, with equal motors, mirrored ones. `loads`: of
  // `other`.
  bool answers(const Run& other, const WheelLoads& loads, double start_speed, double end_speed) const;
  bool uniform() const { return uniform_; }  // loads are the same all along
  bool on_grid() const { return solver_ != nullptr; }
  // Of all grids that it holds, each of some hundred bytes.
  std::size_t nodes() const;
  double shortest_s();

  // Of the run's coordinate.
  double acceleration_limit() const;

 private:
  RunPlanner(const robot::RobotModel& robot, const DriveLoads& loads, const Run& run, const Problem& problem)
      : robot_(&robot), loads_(&loads), run_(&run), problem_(&problem) {}

  struct Ceiling {
    double square = 0;  // of the speed
    Bound bound = Bound::speed;
  };
  Ceiling ceiling(double way) const;
  Place place_at(double way) const { return run_->at(way, near_); }
  double ceiling_at(double way) const { return ceiling(way).square; }
  double voltage_limit_v() const;
  void find_line();
  void find_motion();
  RunAnswer answer_of(SteppedMotion motion) const;
  // On a grid of its own.
  struct FastMotion {
    std::vector<double> nodes;
    SpeedSolution solution;
  };
  const FastMotion& fastest_motion();
  Result<RunAnswer> fastest();
  const SpeedSolution& solve_rough_grid(double price_w, const std::stop_token& stop,
                                        const std::optional<Due>& due = {});
  Result<SpeedSolution> solve_grid(double price_w, const std::stop_token& stop,
                                   const std::optional<Due>& due);
  std::vector<double> driven_j(const std::vector<double>& nodes, const std::vector<double>& z) const;
  // Of each cell: what falls with the number of parts that it is divided into, and with its square.
  struct Losses {
    std::vector<double> by_parts, by_square;
    double sum() const {
      return std::accumulate(by_parts.begin(), by_parts.end(), 0.0) +
             std::accumulate(by_square.begin(), by_square.end(), 0.0);
    }
  };
  Losses lost_j(const SpeedSolution& s, const std::vector<double>& driven) const;
  RunAnswer answer_of(const SpeedSolution& solution, const std::vector<double>& nodes) const;
  bool motors_break(double speed, double acceleration) const;
  bool motors_hold(double top, double most) const;
  Result<void> build_grid();
  SpeedGrid grid_over(const std::vector<double>& nodes) const;
  void add_floor(SpeedGrid& grid) const;
  void build(std::vector<double> nodes);
  Result<void> check_feasible() const;
  std::vector<double> least_parts(const SpeedGrid& grid, const std::vector<double>& nodes,
                                  const std::vector<double>& z, double least) const;
  std::vector<Knot>::const_iterator knot_after(double way) const {
    return std::ranges::upper_bound(run_->knots, way, {}, &Knot::way);
  }
  std::vector<double> split(const std::vector<double>& nodes, const Losses& lost, double most,
                            const std::vector<double>& least) const;
  void add_end_loads(const std::vector<double>& nodes, SpeedGrid& grid) const;
  std::vector<double> first_nodes(std::size_t cells) const;
  std::vector<double> with_corners(std::vector<double> nodes) const;
  std::vector<double> refined_nodes(const std::vector<double>& z, std::size_t cells) const;
  std::vector<double> resampled(const std::vector<double>& nodes, const std::vector<double>& z,
                                const std::vector<double>& onto) const;

  const robot::RobotModel* robot_;
  const DriveLoads* loads_;
  const Run* run_;
  const Problem* problem_;
  mutable std::size_t near_ = 1;  // knot of the place that was looked up last
  double start_ = 0, end_ = 0;
  bool uniform_ = false, refined_ = false;
  std::optional<LineTask> line_;  // where power is quadratic: the task of the closed form
  std::array<dynamics::QuadraticPower, 2> motor_power_{};
  WheelLoads loads_here_{};                         // of a uniform run
  bool motors_never_break_ = false;                 // at any speed and acceleration within the other limits
  double shortest_s_ = 0;                           // without a grid: 0 until asked for
  std::optional<FastMotion> fastest_;               // of a grid, once asked for
  double coarse_error_ = 0, discretisation_j_ = 0;  // of a grid, the first as a share of the cost
  std::unique_ptr<UniformMotion> motion_;           // of a uniform run, where wanted
  std::vector<double> nodes_;
  std::unique_ptr<SpeedSolver> solver_;
  // The first of them, once there are finer ones, and its last solution.
  std::vector<double> rough_nodes_;
  std::unique_ptr<SpeedSolver> rough_solver_;
  double rough_price_w_ = unlimited;
  SpeedSolution rough_;
};

}  // namespace joulecast::planning
