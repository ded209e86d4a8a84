#include "battery/circuit.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "base/units.h"

namespace joulecast::battery {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double kelvin_at_0_c = 273.15;

}  // namespace

Circuit::Circuit(const robot::Battery& battery)
    : open_circuit_voltage_(battery.open_circuit_voltage.empty()
                                ? default_open_circuit_voltage(battery.nominal_voltage_v)
                                : battery.open_circuit_voltage),
      resistance_(battery.resistance_curve.empty()
                      ? std::vector{std::pair(0.5, battery.internal_resistance_ohm)}
                      : battery.resistance_curve),
      resistance_at_half_ohm_(resistance_.held(0.5)),
      capacity_ah_(battery.capacity_ah * battery.ageing_factor.value_or(1)),
      cutoff_voltage_v_(
          battery.cutoff_voltage_v.value_or(default_cutoff_voltage_v(battery.nominal_voltage_v))),
      reserve_fraction_(battery.reserve_fraction),
      coulombic_efficiency_(battery.coulombic_efficiency.value_or(1)),
      activation_k_(battery.activation_k.value_or(0)),
      thermal_resistance_k_w_(battery.thermal_resistance_k_w.value_or(0)),
      thermal_time_constant_s_(battery.thermal_time_constant_s.value_or(infinity)),
      typical_curve_(battery.open_circuit_voltage.empty()) {
  assert(battery.branches.size() <= branches_.size());
  std::fill(branches_.begin(), branches_.end(), robot::BatteryBranch{0, infinity});
  std::copy(battery.branches.begin(), battery.branches.end(), branches_.begin());
  assert(battery.charge_lags.size() <= lags_.size());
  std::fill(lags_.begin(), lags_.end(), robot::ChargeLag{0, infinity});
  std::copy(battery.charge_lags.begin(), battery.charge_lags.end(), lags_.begin());
}

double Circuit::temperature_factor(double temperature_c) const {
  if (activation_k_ == 0) return 1;
  return std::exp(activation_k_ *
                  (1 / (temperature_c + kelvin_at_0_c) - 1 / (reference_temperature_c + kelvin_at_0_c)));
}

double Circuit::ohmic_resistance_ohm(const State& state) const {
  return resistance_.held(state.charge) * temperature_factor(state.temperature_c);
}

double Circuit::branch_resistance_ohm(std::size_t branch, const State& state) const {
  const double shape =
      resistance_at_half_ohm_ > 0 ? resistance_.held(state.charge) / resistance_at_half_ohm_ : 1.0;
  return branches_[branch].resistance_ohm * shape * temperature_factor(state.temperature_c);
}

double Circuit::inner_voltage_v(const State& state) const {
  double voltage = open_circuit_voltage_v(state.surface_charge());
  for (std::size_t k = 0; k < branches_.size(); ++k)
    if (branches_[k].resistance_ohm > 0)
      voltage -= branch_resistance_ohm(k, state) * state.branch_current_a[k];
  return voltage;
}

double Circuit::voltage_v(const State& state, double current_a) const {
  return inner_voltage_v(state) - ohmic_resistance_ohm(state) * current_a;
}

double Circuit::most_power_w(const State& state) const {
  const double inner = inner_voltage_v(state);
  const double resistance = ohmic_resistance_ohm(state);
  return resistance > 0 ? inner * inner / (4 * resistance) : infinity;
}

std::optional<double> Circuit::current_at_power_a(const State& state, double power_w) const {
  const double inner = inner_voltage_v(state);
  if (!(inner > 0)) return std::nullopt;
  const double discriminant = inner * inner - 4 * ohmic_resistance_ohm(state) * power_w;
  if (discriminant < 0) return std::nullopt;
  // The form without cancellation of the smaller root of r I² - E I + P = 0.
  return 2 * power_w / (inner + std::sqrt(discriminant));
}

double Circuit::charge_rate(double current_a) const {
  const double stored = current_a < 0 ? current_a * coulombic_efficiency_ : current_a;
  return -stored / (seconds_per_hour * capacity_ah_);
}

double Circuit::heating_k(const State& state, double current_a) const {
  const double loss_w = current_a * (open_circuit_voltage_v(state.charge) - voltage_v(state, current_a));
  return thermal_resistance_k_w_ * loss_w;
}

State Circuit::rate(const State& state, double current_a, double ambient_c) const {
  State out;
  out.charge = charge_rate(current_a);
  for (std::size_t k = 0; k < branches_.size(); ++k)
    out.branch_current_a[k] = (current_a - state.branch_current_a[k]) / branches_[k].time_constant_s;
  const double factor = temperature_factor(state.temperature_c);
  for (std::size_t k = 0; k < lags_.size(); ++k) {
    const double settled = -factor * lags_[k].lag_s * out.charge;
    out.charge_lag[k] = (settled - state.charge_lag[k]) / (factor * lags_[k].time_constant_s);
  }
  out.temperature_c =
      (heating_k(state, current_a) - (state.temperature_c - ambient_c)) / thermal_time_constant_s_;
  return out;
}

State Circuit::advanced(const State& state, double current_a, double duration_s, double ambient_c) const {
  State out;
  out.charge = state.charge + charge_rate(current_a) * duration_s;
  for (std::size_t k = 0; k < branches_.size(); ++k) {
    const double gone = -std::expm1(-duration_s / branches_[k].time_constant_s);
    out.branch_current_a[k] = state.branch_current_a[k] + gone * (current_a - state.branch_current_a[k]);
  }
  const double factor = temperature_factor(state.temperature_c);
  for (std::size_t k = 0; k < lags_.size(); ++k) {
    const double settled = -factor * lags_[k].lag_s * charge_rate(current_a);
    const double lag_gone = -std::expm1(-duration_s / (factor * lags_[k].time_constant_s));
    out.charge_lag[k] = state.charge_lag[k] + lag_gone * (settled - state.charge_lag[k]);
  }
  const double gone = -std::expm1(-duration_s / thermal_time_constant_s_);
  const double settled_c = gone != 0 ? ambient_c + heating_k(state, current_a) : state.temperature_c;
  out.temperature_c = state.temperature_c + gone * (settled_c - state.temperature_c);
  return out;
}

}  // namespace joulecast::battery
