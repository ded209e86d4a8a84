#pragma once

#include "telemetry/recording.h"

namespace joulecast::gap {

// Moves the battery's voltage and current back by their delay relative to the other channels [s]; negative:
// they lead. Linear between rows; NaN where the moved reading is outside the mission.
void move_battery_back(telemetry::Recording& mission, double delay_s);

// The same for the battery's and the motors' voltages and currents.
void move_electrical_back(telemetry::Recording& mission, double delay_s);

}  // namespace joulecast::gap
