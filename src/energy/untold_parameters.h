#pragma once

#include <vector>

#include "energy/power_calibration.h"
#include "energy/power_fit.h"
#include "energy/power_parameters.h"

namespace joulecast::energy {

// True if the data identify a parameter: they at least halve its expected deviation.
bool told(const PowerParameters& parameters, const PowerFit& fit, PowerParameter p);

// Every parameter with its value, standard error and meaning. An effect that was dropped is listed where the
// data show that it is absent.
std::vector<ParameterEstimate> power_estimates(const PowerParameters& parameters, const PowerFit& fit,
                                               const PowerFree& free);

// Parameters that these data do not identify, with the missing data, and those that no battery power
// identifies.
std::vector<Untold> untold_parameters(const PowerParameters& parameters, const PowerFit& fit);

}  // namespace joulecast::energy
