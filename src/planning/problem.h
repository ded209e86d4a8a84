#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "robot/robot_model.h"

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

}  // namespace joulecast::planning
