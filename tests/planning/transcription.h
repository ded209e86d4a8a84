#pragma once

#include "dynamics/drive_model.h"
#include "planning/path.h"
#include "planning/problem.h"

namespace joulecast::planning::test {

struct TranscribedAnswer {
  double cost_j = 0;  // energy + price of time * duration
  double energy_j = 0, duration_s = 0;
  double excess = 0;  // largest relative violation of a limit at the middle of a cell
};

// Minimum cost of one uniform run by direct transcription: speeds at `cells` + 1 places, constant
// acceleration in between, every cell priced by the drive model itself at three places of its duration.
// Limits hold at the middle of each cell, so that the cost approaches the optimum's as the square of the
// cell. Solved by Newton's method with numerical derivatives, limits as quadratic penalties, braking power
// smoothed, both sharpened step by step. It shares nothing with the planner but the drive model and the run.
TranscribedAnswer transcribed(const robot::RobotModel& robot, const dynamics::DriveModel& model,
                              const Run& run, const Limits& limits, double start_speed, double end_speed,
                              double price_w, int cells);

// Least time of a run from rest to rest: the greatest acceleration and braking at each speed, found by
// bisection on the drive model, integrated over the speed.
double least_time_s(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
                    const Limits& limits);

}  // namespace joulecast::planning::test
