#pragma once

#include "gap/posterior/walk.h"

namespace joulecast::gap::posterior {

// Probability that a strength differs between blocks by less than half of itself. The evidence of the set is
// taken with a scatter of rho |strength| for each rho of `wander_scales`: a load that switches has a mean,
// and the mean looks like a constant.
double constancy(const Fit& fit, std::span<const std::size_t> set, std::size_t member);

}  // namespace joulecast::gap::posterior
