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

using Point = std::pair<double, double>;

// Rounded from published low-rate discharges of many makes; good to some tens of millivolts a cell.
constexpr Point lithium_ion_voltage[] = {{0, 3.00},    {0.02, 3.18}, {0.05, 3.34}, {0.10, 3.45}, {0.20, 3.55},
                                         {0.30, 3.60}, {0.40, 3.64}, {0.50, 3.69}, {0.60, 3.77}, {0.70, 3.86},
                                         {0.80, 3.95}, {0.90, 4.06}, {1, 4.18}};
constexpr Point iron_phosphate_voltage[] = {{0, 2.60},    {0.02, 2.90}, {0.05, 3.06}, {0.10, 3.17},
                                            {0.20, 3.23}, {0.30, 3.26}, {0.50, 3.29}, {0.70, 3.31},
                                            {0.90, 3.33}, {0.97, 3.35}, {1, 3.45}};
constexpr Point lead_voltage[] = {{0, 1.90}, {0.2, 1.96}, {0.5, 2.04}, {0.8, 2.10}, {1, 2.13}};

constexpr double lithium_ion_nominal[] = {3.6, 3.65, 3.7};
constexpr double iron_phosphate_nominal[] = {3.2};
constexpr double lead_nominal[] = {2.0, 2.1};

constexpr CellShape shapes[] = {
    {"lithium-ion", lithium_ion_nominal, 3.0, lithium_ion_voltage},
    {"lithium iron phosphate", iron_phosphate_nominal, 2.5, iron_phosphate_voltage},
    {"lead-acid", lead_nominal, 1.75, lead_voltage},
};

constexpr int lead_block = 3;

double scale(double nominal_voltage_v, const CellShape& cell) {
  return nominal_voltage_v /
         Curve({cell.open_circuit_voltage.begin(), cell.open_circuit_voltage.end()}).mean();
}

}  // namespace

const CellShape& likeliest_cell(double nominal_voltage_v) {
  assert(nominal_voltage_v > 0);
  const CellShape* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const CellShape& cell : shapes) {
    const int block = &cell == &shapes[2] ? lead_block : 1;
    for (const double nominal : cell.usual_nominal_v) {
      const double blocks = std::max(1.0, std::round(nominal_voltage_v / (block * nominal)));
      const double miss = std::abs(nominal_voltage_v / (blocks * block * nominal) - 1);
      // A thousandth closer is no better: printed voltages are rounded.
      if (miss < least - 1e-3) {
        least = miss;
        best = &cell;
      }
    }
  }
  return *best;
}

std::vector<std::pair<double, double>> default_open_circuit_voltage(double nominal_voltage_v) {
  const CellShape& cell = likeliest_cell(nominal_voltage_v);
  const double factor = scale(nominal_voltage_v, cell);
  std::vector<std::pair<double, double>> curve(cell.open_circuit_voltage.begin(),
                                               cell.open_circuit_voltage.end());
  for (auto& [charge, voltage] : curve) voltage *= factor;
  return curve;
}

double default_cutoff_voltage_v(double nominal_voltage_v) {
  const CellShape& cell = likeliest_cell(nominal_voltage_v);
  return cell.cutoff_v * scale(nominal_voltage_v, cell);
}

Curve::Curve(std::vector<std::pair<double, double>> points) : points_(std::move(points)) {
  assert(!points_.empty());
}

// The index of the point that starts the piece on which x lies; the end pieces reach to infinity.
std::size_t Curve::piece(double x) const {
  const auto above = std::upper_bound(points_.begin() + 1, points_.end() - 1, x,
                                      [](double value, const auto& point) { return value < point.first; });
  return static_cast<std::size_t>(above - points_.begin()) - 1;
}

double Curve::held(double x) const {
  return extended(std::clamp(x, points_.front().first, points_.back().first));
}

double Curve::extended(double x) const {
  if (points_.size() == 1) return points_.front().second;
  const std::size_t i = piece(x);
  const auto& [x0, y0] = points_[i];
  const auto& [x1, y1] = points_[i + 1];
  return y0 + (y1 - y0) * ((x - x0) / (x1 - x0));
}

double Curve::mean() const {
  if (points_.size() == 1) return points_.front().second;
  double area = 0;
  for (std::size_t i = 1; i < points_.size(); ++i)
    area += (points_[i].first - points_[i - 1].first) * (points_[i].second + points_[i - 1].second) / 2;
  return area / (points_.back().first - points_.front().first);
}

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
