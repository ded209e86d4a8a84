#pragma once

#include <vector>

#include "dynamics/climb.h"
#include "dynamics/parameters.h"
#include "signals/gaps.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// Samples in order of time as dynamics/climb.h reads them, on a robot of these parameters. Pitch that is
// measured less often than samples come is held between gaps.
class ClimbReader {
 public:
  dynamics::ClimbReading at(const dynamics::Parameters<double>& parameters, const signals::Sample& sample,
                            double height_m, signals::Step step);

 private:
  signals::HeldReading pitch_;
};

// The climb at each sample of a recording (dynamics::climb_along): from its pitch, else covariate height_m.
[[nodiscard]] std::vector<double> climb_of(const Recording& recording,
                                           const dynamics::Parameters<double>& parameters);

}  // namespace joulecast::telemetry
