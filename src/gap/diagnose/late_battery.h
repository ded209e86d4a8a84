#pragma once

#include "telemetry/recording.h"

namespace joulecast::gap {

// Moves the battery's voltage and current back by what they lag the other channels [s]; negative: they lead.
// Between rows linearly; NaN where the mission ends before, or begins after, what would have been read.
void move_battery_back(telemetry::Recording& mission, double delay_s);

}  // namespace joulecast::gap
