#pragma once

#include <span>

#include "base/error.h"
#include "dynamics/drive_model.h"
#include "planning/path.h"

namespace joulecast::planning {

// What robots drive without a planner, to compare with: on every run the speed ramps up, holds and ramps
// down.
struct Baseline {
  double energy_j = 0;  // from the battery, dwells included
  double duration_s = 0;
  double peak_speed_m_s = 0;
  double peak_acceleration_m_s2 = 0;  // absolute, along the way
};

// Each run takes `run_duration_s`, accelerating for `ramp_fraction` of it and braking for as long: 1/3 is the
// trapezoid of thesis 4.3.1, 1/2 the triangle. Infeasible when a run is too short for its end speeds in that
// time.
Result<Baseline> ramp_baseline(const dynamics::DriveModel& model, const Path& path,
                               std::span<const double> run_duration_s, double start_speed_m_s,
                               double end_speed_m_s, double ramp_fraction);

}  // namespace joulecast::planning
