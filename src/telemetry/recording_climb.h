#pragma once

#include <vector>

#include "dynamics/climb.h"
#include "dynamics/parameters.h"
#include "signals/gaps.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// A sample as dynamics/climb.h reads it, on a robot of these parameters.
[[nodiscard]] dynamics::ClimbReading climb_reading(const dynamics::Parameters<double>& parameters,
                                                   const signals::Sample& sample, double height_m,
                                                   signals::Step step);

// The climb at each sample of a recording (dynamics::climb_along): from its pitch, else from its covariate
// height_m.
[[nodiscard]] std::vector<double> climb_of(const Recording& recording,
                                           const dynamics::Parameters<double>& parameters);

}  // namespace joulecast::telemetry
