#pragma once

#include <span>
#include <vector>

#include "gap/equations/channels.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/log_recordings.h"

namespace joulecast::gap {

// Returns the regions of every variable in which the mean residual of a channel's power differs significantly
// from zero (block standard errors, Bonferroni), sorted by the excess of their share of the gap over that of
// the time. Empty where the gap is no larger than `noise_floor`, of the power.
std::vector<WhereRegion> localise(std::span<const Window> windows, const robot::RobotModel& robot,
                                  std::span<const double> measured_w, std::span<const double> modelled_w,
                                  double noise_floor, const std::string& channel);

// Returns the data of a report's plots: residual power over its candidate variables, over the floor, over
// time and by mission, by the model as it is and with the effects found. Powers are of the windows, in watts.
Figures figures_of(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> before_w, std::span<const double> after_w,
                   const telemetry::RecordingSet& recordings, const robot::RobotModel& robot);

}  // namespace joulecast::gap
