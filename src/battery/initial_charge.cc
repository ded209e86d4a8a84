#include "battery/initial_charge.h"

namespace joulecast::battery {

double charge_at_rest(const Circuit& circuit, double voltage_v, double current_a) {
  double low = 0, high = 1;
  constexpr int halvings = 40;
  for (int k = 0; k < halvings; ++k) {
    const double middle = 0.5 * (low + high);
    const State rested = Circuit::rested(middle);
    (circuit.voltage_v(rested, current_a) < voltage_v ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace joulecast::battery
