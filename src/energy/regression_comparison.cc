#include "energy/regression_comparison.h"

#include "base/try.h"
#include "dynamics/drive_model.h"

namespace joulecast::energy {

Result<RegressionComparison> compare_with_regression(std::span<const telemetry::Recording> learnt_from,
                                                     std::span<const telemetry::Recording> tested,
                                                     const robot::RobotModel& file,
                                                     const robot::RobotModel& corrected) {
  TRY_ASSIGN(const auto by_file, dynamics::drive_model(file));
  TRY_ASSIGN(const auto by_corrected, dynamics::drive_model(corrected));
  TRY_ASSIGN(const auto learnt, power_windows(learnt_from, file));
  TRY_ASSIGN(const auto held_back, power_windows(tested, file));
  const PlainRegression regression(learnt.windows, file);
  MissedPowerMeter missed;
  for (const windows::Window& w : held_back.windows) missed.add(w, by_file, by_corrected, regression);
  return RegressionComparison{held_back.windows.size(), missed.value()};
}

}  // namespace joulecast::energy
