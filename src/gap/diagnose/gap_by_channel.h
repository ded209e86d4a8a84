#pragma once

#include <vector>

#include "gap/posterior/walk.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Returns the gap of each kind of recorded reading, and its noise floor: the residual of a fit of all
// columns. A battery voltage is compared after its open-circuit level was fitted to each block.
std::vector<ChannelGap> channel_gaps(const posterior::Fit& fit);

}  // namespace joulecast::gap
