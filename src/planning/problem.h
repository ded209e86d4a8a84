#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "robot/robot_model.h"
#include "signals/ledger.h"

namespace joulecast::planning {

inline constexpr double unlimited = std::numeric_limits<double>::infinity();

// Bounds on motion and motors, absolute values. The acceleration limit holds along the way; turning in place,
// it holds for the wheels' rims. Current and voltage are of each armature.
struct Limits {
  double speed_m_s = unlimited;
  double acceleration_m_s2 = unlimited;
  double yaw_rate_rad_s = unlimited;
  double wheel_speed_rad_s = unlimited;
  double current_a = unlimited;
  double voltage_v = unlimited;
  // Along the way between starts and stops, for vehicles that cannot creep; a lower bound.
  double least_speed_m_s = 0;
};

// The limits of a robot file; the armature voltage is bounded by the battery's nominal voltage.
Limits limits_of(const robot::RobotModel& robot);

// The planner's task. It minimises battery energy + value_of_time_w * duration, the robot's own idle power
// being part of its battery energy.
struct Problem {
  Limits limits;
  double start_speed_m_s = 0;
  double end_speed_m_s = 0;
  double value_of_time_w = 0;
  std::optional<double> deadline_s;  // latest arrival, dwells included
  // The fastest motion that takes at most this energy [J]; without a deadline and a value of time.
  std::optional<double> energy_budget_j;
  std::optional<double>
      regeneration;  // fraction of braking power that returns, 0 to 1; absent: by the robot's effects
  std::size_t intervals_per_run = 64;  // speed grid of a run with constant power along its way
  bool rows = true;                    // whether the plan carries its profile
  bool hurried = false;                // keep as closely to the motors' limits as where there is a deadline
};

// A planned motion as columns of equal length. Between rows the acceleration along the way is constant, hence
// the speed linear in time; `acceleration` and `power` of a row hold just after it (of the last: just
// before).
struct Profile {
  std::vector<double> time_s;
  std::vector<double> distance_m;  // driven since the start; turning in place adds none
  std::vector<double> x_m, y_m, heading_rad;
  std::vector<double> speed_m_s, yaw_rate_rad_s;
  std::vector<double> acceleration_m_s2, yaw_acceleration_rad_s2;
  std::vector<double> payload_kg;
  std::vector<double> power_w;   // at the battery
  std::vector<double> energy_j;  // from the battery since the start

  std::size_t size() const { return time_s.size(); }
};

struct Summary {
  double energy_j = 0;    // from the battery, dwells included
  double duration_s = 0;  // dwells included
  double distance_m = 0;
  double turned_rad = 0;
  double peak_speed_m_s = 0;
  double peak_yaw_rate_rad_s = 0;
  double peak_power_w = 0;
  double braking_j = 0;    // electrical energy that the motors generated
  double recovered_j = 0;  // the part of it that reached the battery
};

enum class Method { closed_form, quadrature, interior_point, mixed };
std::string_view name_of(Method method);

enum class Bound { speed, yaw_rate, wheel_speed, acceleration, current, voltage, deadline, energy_budget };
inline constexpr std::size_t bound_count = 8;
std::string_view name_of(Bound bound);

// How far the answer is from the optimum.
struct Certificate {
  Method method = Method::closed_form;
  // energy + price of time, less this, bounds the optimum over all speed profiles on the grid from below: the
  // complementarity gap of the multipliers plus the greatest effect of smoothing the regeneration kink. Holds
  // globally when `convex`; otherwise near this answer.
  double gap_j = 0;
  // Bound on the excess over the optimum of a continuous acceleration. By quadrature: the integral of the
  // excess cost of each cell's constant acceleration over the best one at each speed. On a grid: the excess
  // of a grid of half as many cells or fewer, three times Richardson's estimate, plus the cells' cost above
  // the grid's own estimate, as loads, limits of motors and the flow of power change within them.
  double discretisation_j = 0;
  double residual = 0;  // largest stationarity residual over the cost, 0 for the closed form to rounding
  bool convex = true;
  // Cost of shortening the motion by a second, per second; 0 where the time is the cheapest. The deadline's
  // multiplier plus the value of time, or the inverse of the energy budget's.
  double time_multiplier_w = 0;
  double shortest_time_s = 0;  // of the fastest motion that the limits allow, dwells included
  std::vector<Bound> binding;
  int iterations = 0;
};

struct Plan {
  Profile profile;
  std::vector<double> run_duration_s;  // of each run between stops, dwells left out
  Summary summary;
  signals::Ledger ledger;  // joules
  Certificate certificate;
};

}  // namespace joulecast::planning
