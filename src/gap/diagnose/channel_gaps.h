#pragma once

#include <vector>

#include "gap/equations/columns.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// How large the gap of each kind of reading is, and how much of it a fit of everything that may be there,
// with every coefficient free, leaves over: the noise floor. What was not read is left out. A battery voltage
// is compared after its open-circuit level, which nobody knows, has been fitted to each mission.
std::vector<ChannelGap> channel_gaps(const Material& material);

}  // namespace joulecast::gap
