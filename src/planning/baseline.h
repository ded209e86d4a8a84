#pragma once

#include <span>
#include <vector>

#include "base/error.h"
#include "planning/load.h"
#include "planning/path.h"
#include "planning/problem.h"

namespace joulecast::planning {

// The motion of robots without a planner, for comparison: on every run the speed ramps up, is constant and
// ramps down.
struct Baseline : Peaks {
  double energy_j = 0;  // from the battery, dwells included
  double duration_s = 0;

  // The motion over time, if requested; columns of equal length. Energy since the start.
  std::vector<double> time_s, speed_m_s, yaw_rate_rad_s, power_w, energy_column_j;
};

// Each run takes `run_duration_s`, accelerating for `ramp_fraction` of it and braking for as long: 1/3 is the
// trapezoid of thesis 4.3.1, 1/2 the triangle. Infeasible when a run is too short for its end speeds in that
// time.
Result<Baseline> ramp_baseline(const DriveLoads& loads, const Path& path,
                               std::span<const double> run_duration_s, double start_speed_m_s,
                               double end_speed_m_s, double ramp_fraction, bool columns = false);

}  // namespace joulecast::planning
