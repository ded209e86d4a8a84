#pragma once

#include <optional>

#include "robot/robot_model.h"
#include "telemetry/log_recordings.h"
#include "tests/study/trial/case_files.h"

namespace joulecast::trial {

// Fraction of the held-out absolute power gap that is removed when the true effects and their shapes are
// given, and only their strengths are fitted to the other missions (least absolute deviations): an upper
// bound for a diagnosis. Empty without an effect of the catalogue, with fewer than two missions, or without
// battery power.
[[nodiscard]] std::optional<double> oracle_shrinkage(const telemetry::RecordingSet& recordings,
                                                     const robot::RobotModel& robot,
                                                     const SealedTruth& truth);

}  // namespace joulecast::trial
