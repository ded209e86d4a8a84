#pragma once

#include <span>

#include "gap/equations/channels.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/recording_set.h"

namespace joulecast::gap {

// Returns the data of a report's plots: residual power over its candidate variables, over the floor, over
// time and by mission, by the model as it is and with the effects found. Powers are of the windows, in watts,
// NaN where unknown.
Figures figures_of(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> before_w, std::span<const double> after_w,
                   const telemetry::RecordingSet& recordings, const robot::RobotModel& robot);

}  // namespace joulecast::gap
