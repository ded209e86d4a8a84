#include "energy/regression_comparison.h"

#include "dynamics/drive_model.h"

namespace joulecast::energy {

Result<RegressionComparison> compare_with_regression(std::span<const telemetry::Recording> learnt_from,
                                                     std::span<const telemetry::Recording> tested,
                                                     const robot::RobotModel& file,
                                                     const robot::RobotModel& corrected) {
  const auto by_file = dynamics::drive_model(file);
  if (!by_file) return tl::unexpected(by_file.error());
  const auto by_corrected = dynamics::drive_model(corrected);
  if (!by_corrected) return tl::unexpected(by_corrected.error());
  const auto learnt = power_windows(learnt_from, file);
  if (!learnt) return tl::unexpected(learnt.error());
  const auto held_back = power_windows(tested, file);
  if (!held_back) return tl::unexpected(held_back.error());
  const PlainRegression regression(learnt->windows, file);
  MissedPowerMeter missed;
  for (const windows::Window& w : held_back->windows) missed.add(w, *by_file, *by_corrected, regression);
  return RegressionComparison{held_back->windows.size(), missed.value()};
}

}  // namespace joulecast::energy
