#pragma once

#include <vector>

#include "energy/power_calibration.h"
#include "energy/power_fit.h"
#include "energy/power_parameters.h"

namespace joulecast::energy {

// Whether the data tell a parameter: they halve, or better, what is left open without them.
bool told(const PowerParameters& parameters, const PowerFit& fit, PowerParameter p);

// Every parameter with its value, standard error and what it stands for. An effect that was given up is
// listed where the data tell that there is nothing of it.
std::vector<ParameterEstimate> power_estimates(const PowerParameters& parameters, const PowerFit& fit,
                                               const PowerFree& free);

// What these data do not tell, for what in them is missing, and what no battery power tells.
std::vector<Untold> untold_parameters(const PowerParameters& parameters, const PowerFit& fit);

}  // namespace joulecast::energy
