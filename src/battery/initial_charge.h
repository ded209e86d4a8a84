#pragma once

#include "battery/circuit.h"

namespace joulecast::battery {

// Charge, 0 to 1, at which a battery that has rested shows `voltage_v` while it gives `current_a`: the
// inverse of U(s) - r(s) I, clamped to empty and full. A first guess where the charge was never counted: a
// voltage error dV becomes dV / U'(s), several per cent on a flat curve, and a battery that has not rested
// misleads it.
double charge_at_rest(const Circuit& circuit, double voltage_v, double current_a);

}  // namespace joulecast::battery
