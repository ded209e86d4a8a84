#pragma once

#include "telemetry/recording.h"

namespace joulecast::gap {

// Moves the battery's voltage and current back by their delay behind the other channels [s]; negative: they
// lead. Linear between rows; NaN where the mission ends before, or begins after, the moved reading.
void move_battery_back(telemetry::Recording& mission, double delay_s);

// The same of the battery's and the motors' voltages and currents.
void move_electrical_back(telemetry::Recording& mission, double delay_s);

}  // namespace joulecast::gap
