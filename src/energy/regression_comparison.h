#pragma once

#include <cstddef>
#include <span>

#include "base/error.h"
#include "energy/power_windows.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::energy {

// Battery power of missions that were not used for a fit, by a robot file, by the file corrected from other
// missions, and by a plain regression on those others.
struct RegressionComparison {
  std::size_t windows = 0;
  MissedPower missed;

  // Beyond a twentieth, within which either may be ahead by chance.
  bool regression_wins() const { return missed.corrected > 1.05 * missed.regression; }
};

// Fault::invalid when power is not measured or too little of it, in either set of missions, or when the
// catalogue of effects rejects a model; the error names the missing data.
Result<RegressionComparison> compare_with_regression(std::span<const telemetry::Recording> learnt_from,
                                                     std::span<const telemetry::Recording> tested,
                                                     const robot::RobotModel& file,
                                                     const robot::RobotModel& corrected);

}  // namespace joulecast::energy
