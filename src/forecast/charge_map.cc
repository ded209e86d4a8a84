#include "forecast/charge_map.h"

#include <algorithm>
#include <cmath>

#include "planning/root.h"

namespace joulecast::forecast {
namespace {

constexpr std::size_t steps = 200;

}  // namespace

ChargeMap::ChargeMap(const battery::Circuit& circuit) : circuit_(circuit), stored_j_(steps + 1, 0.0) {
  const double h = 1.0 / static_cast<double>(steps), coulombs = 3600 * circuit_.capacity_ah();
  for (std::size_t k = 0; k < steps; ++k) {
    const double s = h * static_cast<double>(k);
    stored_j_[k + 1] =
        stored_j_[k] +
        coulombs * h * 0.5 * (circuit_.open_circuit_voltage_v(s) + circuit_.open_circuit_voltage_v(s + h));
  }
}

double ChargeMap::stored_j(double charge) const {
  const double coulombs = 3600 * circuit_.capacity_ah();
  if (charge <= 0) return coulombs * charge * circuit_.open_circuit_voltage_v(0);
  if (charge >= 1) return stored_j_.back() + coulombs * (charge - 1) * circuit_.open_circuit_voltage_v(1);
  const double at = charge * static_cast<double>(steps);
  const auto k = std::min(static_cast<std::size_t>(at), steps - 1);
  return std::lerp(stored_j_[k], stored_j_[k + 1], at - static_cast<double>(k));
}

double ChargeMap::share(double charge, double mean_power_w) const {
  const battery::State state = battery::Circuit::rested(std::clamp(charge, 0.02, 1.0));
  const double open = circuit_.inner_voltage_v(state);
  const double resistance = circuit_.ohmic_resistance_ohm(state) + circuit_.branch_resistance_ohm(0, state) +
                            circuit_.branch_resistance_ohm(1, state);
  const double left = 1 - 4 * resistance * mean_power_w / (open * open);
  return 0.5 * (1 + std::sqrt(std::max(0.0, left)));
}

double ChargeMap::energy_j(double from, double to, double mean_power_w) const {
  return share(std::max(from, to), mean_power_w) * (stored_j(from) - stored_j(to));
}

double ChargeMap::charge_after(double from, double energy_j, double mean_power_w) const {
  const double wanted = stored_j(from) - energy_j / share(from, mean_power_w);
  const double coulombs = 3600 * circuit_.capacity_ah();
  if (wanted <= 0) return wanted / (coulombs * circuit_.open_circuit_voltage_v(0));
  if (wanted >= stored_j_.back())
    return 1 + (wanted - stored_j_.back()) / (coulombs * circuit_.open_circuit_voltage_v(1));
  const auto above = std::ranges::upper_bound(stored_j_, wanted);
  const auto k = static_cast<std::size_t>(above - stored_j_.begin()) - 1;
  return (static_cast<double>(k) + (wanted - stored_j_[k]) / (stored_j_[k + 1] - stored_j_[k])) /
         static_cast<double>(steps);
}

double ChargeMap::cutoff_charge(double mean_power_w) const {
  const auto above_cutoff = [&](double charge) {
    const battery::State state = battery::Circuit::rested(charge);
    return share(charge, mean_power_w) * circuit_.inner_voltage_v(state) > circuit_.cutoff_voltage_v();
  };
  if (above_cutoff(0)) return 0;
  return 1 - planning::last_that([&](double used) { return above_cutoff(1 - used); }, 0, 1, 20);
}

double ChargeMap::slope_j(double charge, double mean_power_w) const {
  return 3600 * circuit_.capacity_ah() * circuit_.open_circuit_voltage_v(charge) *
         share(charge, mean_power_w);
}

}  // namespace joulecast::forecast
