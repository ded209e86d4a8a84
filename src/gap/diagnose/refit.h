#pragma once

#include <span>
#include <vector>

#include "gap/diagnose/linear.h"

namespace joulecast::gap {

// The strengths with which these causes alone, the robot file's other parameters as they are, leave least:
// damped Gauss-Newton steps on all equations until they rest. Shapes stay; strengths stay within their
// bounds.
std::vector<Cause> refit(const Material& material, std::vector<Cause> causes);

// Where the parameters that every robot has (idle power, friction, mass, winding resistance, resistance to
// turning, drag) would have to be for these recordings, whatever is behind it: a place to begin from where a
// robot file is far off. It starts where the drive is without copper loss and its power is the plain
// regression's, or there and at the robot file, and keeps what leaves less.
enum class Starts { regression, both };
std::vector<Cause> base_fit(const Material& material, std::span<const double> power_w, Starts starts);

}  // namespace joulecast::gap
