#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <vector>

#include "planning/load.h"
#include "planning/path.h"
#include "planning/problem.h"
#include "robot/robot_model.h"

namespace joulecast::planning {

// Energy and duration of the optimum, without its profile.
struct PlanCost {
  double energy_j = 0;
  double duration_s = 0;
  double time_multiplier_w = 0;
  double peak_speed_m_s = 0;
  bool closed_form = true;  // of every run, or by quadrature: SpeedSolver was not needed
};

// Minimum-energy motion of one robot along paths. Each run between stops is solved in closed form where its
// power is quadratic, motors stay within their limits and no regeneration is lost; by UniformMotion where its
// loads are the same all along; otherwise by SpeedSolver. Runs are joined by one multiplier of time: the
// value of time, raised until the deadline is met, or until the energy budget is spent.
//
// Infeasible requests are errors with Fault::infeasible that name the field and the nearest feasible value.
// Work ends soon after a stop is requested, with Fault::stopped.
class Planner {
 public:
  // `regeneration` replaces the fraction of braking power that the robot's adopted effects return.
  static Result<Planner> make(const robot::RobotModel& robot, std::optional<double> regeneration = {});

  // `problem.regeneration` is read by make and by the free function, not here.
  Result<Plan> plan(const Path& path, const Problem& problem, std::stop_token stop = {}) const;
  // The same where closed forms provide the answer, in some tens of microseconds; empty if it takes longer,
  // or is an error.
  std::optional<Plan> plan_at_once(const Path& path, const Problem& problem) const;
  Result<PlanCost> cost(const Path& path, const Problem& problem, std::stop_token stop = {}) const;
  // A run by itself, without its dwell, with that payload.
  Result<PlanCost> cost(Run run, double payload_kg, const Problem& problem, std::stop_token stop = {}) const;

  // The speed that the deadline needs: the least speed limit under which the path can still be driven in
  // time, to 1e-4. Needs a deadline; infeasible when it cannot be met at all.
  Result<double> needed_speed(const Path& path, const Problem& problem, std::stop_token stop = {}) const;

  // Energy against duration from the free optimum to near the shortest time: `count` >= 2 deadlines, evenly
  // spaced, fewer where the grid does not distinguish their motions; only the free optimum where that is the
  // shortest time already.
  Result<std::vector<PlanCost>> pareto(const Path& path, const Problem& problem, std::size_t count,
                                       std::stop_token stop = {}) const;

  // The loads of the robot's drive, with that regeneration.
  const DriveLoads& loads() const { return loads_; }

 private:
  Planner(const robot::RobotModel& robot, DriveLoads loads) : robot_(robot), loads_(std::move(loads)) {}

  robot::RobotModel robot_;
  DriveLoads loads_;
};

// A plan of more rows is refused (Fault::too_large).
inline constexpr std::size_t most_rows = 500'000;

Result<Plan> plan(const robot::RobotModel& robot, const Path& path, const Problem& problem,
                  std::stop_token stop = {});

}  // namespace joulecast::planning
