#pragma once

#include "dynamics/drive_model.h"
#include "planning/path.h"
#include "planning/problem.h"

namespace joulecast::planning::test {

struct ReferenceAnswer {
  double cost_j = 0;  // energy + value of time * duration
  double energy_j = 0;
  double duration_s = 0;
  double excess = 0;  // largest relative violation of a limit
};

// Minimum cost of one run by iterative dynamic programming (Luus 1990): speeds on a table of stations by
// levels, every transition priced by the drive model itself, the table drawn closer round the best profile
// again and again. It shares nothing with the planner but the drive model and the path.
ReferenceAnswer reference(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
                          const Limits& limits, double start_speed, double end_speed, double price_w,
                          int stations = 48);

}  // namespace joulecast::planning::test
