#pragma once

#include <string>
#include <vector>

#include "battery/circuit.h"
#include "battery/recording.h"

namespace joulecast::battery {

// The log of `truth`, drawn empty by repeating `currents_a`, each for `hold_s`.
inline Recording simulated(const Circuit& truth, const std::string& name,
                           const std::vector<double>& currents_a, double hold_s, double row_s) {
  Recording out{name, {0}, {0}, {truth.open_circuit_voltage_v(1)}, {25}};
  State state = Circuit::rested(1);
  double now_s = 0;
  for (std::size_t step = 0;; ++step) {
    const double current_a = currents_a[step % currents_a.size()];
    for (double held = 0; held < hold_s; held += row_s) {
      for (int i = 0; i < 10; ++i) state = truth.advanced(state, current_a, row_s / 10, 25);
      now_s += row_s;
      out.time_s.push_back(now_s);
      out.current_a.push_back(current_a);
      out.voltage_v.push_back(truth.voltage_v(state, current_a));
      out.temperature_c.push_back(state.temperature_c);
      if (out.voltage_v.back() <= truth.cutoff_voltage_v()) return out;
    }
  }
}

inline std::vector<Recording> identification(const Circuit& truth) {
  const double c = truth.capacity_ah();
  return {simulated(truth, "slow", {c / 20}, 1e6, 60), simulated(truth, "half", {c / 2}, 1e6, 10),
          simulated(truth, "one", {c}, 1e6, 10), simulated(truth, "two", {2 * c}, 1e6, 10),
          simulated(truth, "pulses", {c / 2, 0, 0}, 600, 10)};
}

}  // namespace joulecast::battery
