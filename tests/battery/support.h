#pragma once

#include "robot/robot_model.h"

namespace joulecast::battery {

// A battery with all features: curves, branches, lags, temperature, ageing, efficiency.
inline robot::Battery full_battery() {
  robot::Battery battery;
  battery.nominal_voltage_v = 3.7;
  battery.capacity_ah = 2.5;
  battery.internal_resistance_ohm = 0.05;
  battery.reserve_fraction = 0.15;
  battery.open_circuit_voltage = {{0, 2.6}, {0.1, 3.3}, {0.5, 3.7}, {1, 4.2}};
  battery.resistance_curve = {{0.1, 0.12}, {0.3, 0.05}, {1, 0.04}};
  battery.branches = {{0.015, 25}, {0.02, 600}};
  battery.charge_lags = {{60, 40}, {150, 1500}};
  battery.cutoff_voltage_v = 2.5;
  battery.coulombic_efficiency = 0.98;
  battery.ageing_factor = 0.9;
  battery.activation_k = 2500;
  battery.thermal_resistance_k_w = 5;
  battery.thermal_time_constant_s = 700;
  return battery;
}

// Constant voltage behind a constant resistance: it has closed forms.
inline robot::Battery plain_battery() {
  robot::Battery battery;
  battery.nominal_voltage_v = 24;
  battery.capacity_ah = 10;
  battery.internal_resistance_ohm = 0.1;
  battery.open_circuit_voltage = {{0, 24}, {1, 24}};
  battery.cutoff_voltage_v = 10;
  return battery;
}

}  // namespace joulecast::battery
