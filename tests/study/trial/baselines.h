#pragma once

#include <array>
#include <string_view>

#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"
#include "telemetry/log_recordings.h"

namespace joulecast::trial {

// Baseline methods: each uses the residual of battery power alone and treats samples as independent.
enum class Baseline {
  multiplier,    // one factor on the modelled power: names nothing
  regression,    // of power on a constant, |speed|, |yaw rate| and speed times acceleration: names nothing
  stepwise_bic,  // forward and backward regression on the catalogue's terms, by Schwarz's criterion
  thresholded_squares,  // sequentially thresholded ridge regression (Brunton, Proctor and Kutz 2016)
};
inline constexpr std::array baselines{Baseline::multiplier, Baseline::regression, Baseline::stepwise_bic,
                                      Baseline::thresholded_squares};
[[nodiscard]] std::string_view name_of(Baseline baseline);

// Verdict, effects with strengths, and shrinkage on missions held out; the other fields stay empty.
[[nodiscard]] gap::Diagnosis diagnose_by(Baseline baseline, const telemetry::RecordingSet& recordings,
                                         const robot::RobotModel& robot);

}  // namespace joulecast::trial
