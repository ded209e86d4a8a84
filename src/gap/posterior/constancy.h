#pragma once

#include "gap/posterior/walk.h"

namespace joulecast::gap::posterior {

// How constant a strength is over the blocks, formula (5).
struct Constancy {
  double probability = 1;  // that it differs between blocks by less than half of itself
  double scatter = 0;      // posterior mean of rho
};
Constancy constancy(const Fit& fit, std::span<const std::size_t> set, std::size_t member);

}  // namespace joulecast::gap::posterior
