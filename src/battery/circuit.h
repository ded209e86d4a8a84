#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "robot/robot_model.h"

namespace joulecast::battery {

// A typical cell of one chemistry, used until a battery is calibrated.
struct CellShape {
  std::string_view chemistry;
  std::span<const double> usual_nominal_v;  // as printed by makers, for one cell
  double cutoff_v;
  std::span<const std::pair<double, double>> open_circuit_voltage;  // (charge, V), from 0 to 1
};

// The cell of which some number in series has the printed voltage closest to `nominal_voltage_v` > 0; of
// equally close ones lithium-ion, then iron phosphate, then lead. Lead comes in blocks of three cells (6 V)
// only.
const CellShape& likeliest_cell(double nominal_voltage_v);

// The pack's open-circuit voltage, scaled so that its mean over charge is the nominal voltage: a full pack
// holds nominal_voltage_v * capacity_ah watt-hours.
std::vector<std::pair<double, double>> default_open_circuit_voltage(double nominal_voltage_v);

double default_cutoff_voltage_v(double nominal_voltage_v);

// A piecewise linear function through points of ascending x.
class Curve {
 public:
  // At least one point, x strictly ascending.
  explicit Curve(std::vector<std::pair<double, double>> points);

  double held(double x) const;      // constant beyond the ends
  double extended(double x) const;  // beyond the ends, along the first and the last piece
  double mean() const;              // over [first x, last x]

 private:
  std::size_t piece(double x) const;

  std::vector<std::pair<double, double>> points_;
};

inline constexpr double reference_temperature_c = 25.0;

// The inner state of a battery.
struct State {
  double charge = 1;                         // share of the present capacity, 1 full
  std::array<double, 2> branch_current_a{};  // through each branch's resistor, positive discharging
  std::array<double, 2> charge_lag{};        // by which the surface's charge is below the mean
  double temperature_c = reference_temperature_c;

  double surface_charge() const { return charge - charge_lag[0] - charge_lag[1]; }
};

// The battery's equivalent circuit, currents positive while discharging:
//   V = U(s - d_1 - d_2) - r(s, T) I - sum_k r_k(s, T) j_k,
//   s' = -I / (3600 C),   j_k' = (I - j_k) / tau_k,   d_k' = (a L_k I / (3600 C) - d_k) / (a theta_k)
// with U the open-circuit voltage, r the ohmic resistance over charge s, and
//   a = exp(B (1/T - 1/298.15 K)),   r(s, T) = a r(s),   r_k(s, T) = R_k r(s, T) / r(0.5, 25 °C),
// C capacity times ageing factor, and s' multiplied by the coulombic efficiency while charging. The d_k let
// the charge at the electrodes' surface, which sets the voltage, run ahead of the mean as diffusion does;
// near empty this, not resistance, ends a discharge. The losses I (U(s) - V) heat one lumped mass: tau_T T' =
// R_T I (U - V) - (T - T_ambient); without thermal parameters the temperature stays as given.
// Values missing in the robot file have defaults: the open-circuit shape of the likeliest chemistry
// (default_open_circuit_voltage), constant resistance, no branches, no lags, no effect of temperature. Beyond
// charge 0 and 1 the voltage goes on along the last piece of its curve, so that a voltage threshold is always
// crossed.
class Circuit {
 public:
  // The battery must satisfy the robot file's constraints (robot::validate).
  explicit Circuit(const robot::Battery& battery);

  double capacity_ah() const { return capacity_ah_; }  // present, ageing included
  double cutoff_voltage_v() const { return cutoff_voltage_v_; }
  double reserve_fraction() const { return reserve_fraction_; }
  bool typical_curve() const { return typical_curve_; }  // the robot file has no open-circuit curve

  double open_circuit_voltage_v(double charge) const { return open_circuit_voltage_.extended(charge); }
  double ohmic_resistance_ohm(const State& state) const;
  double branch_resistance_ohm(std::size_t branch, const State& state) const;

  // Voltage behind the ohmic resistance: that of the terminals at no current.
  double inner_voltage_v(const State& state) const;
  double voltage_v(const State& state, double current_a) const;

  // The current at which the terminals deliver `power_w` (negative: take it in), the smaller of the two; none
  // when no current does.
  std::optional<double> current_at_power_a(const State& state, double power_w) const;
  double most_power_w(const State& state) const;  // infinite without resistance

  // Time derivatives, in the units of State per second.
  State rate(const State& state, double current_a, double ambient_c) const;

  // The state after a constant current: exact in charge and branches; the heat of the interval's start is
  // held over it, so intervals should be short against the thermal time constant.
  State advanced(const State& state, double current_a, double duration_s, double ambient_c) const;

  // At rest: branches relaxed, at the given charge and temperature.
  static State rested(double charge, double temperature_c = reference_temperature_c) {
    return {charge, {}, {}, temperature_c};
  }

 private:
  double temperature_factor(double temperature_c) const;
  double heating_k(const State& state, double current_a) const;  // steady temperature rise
  double charge_rate(double current_a) const;

  Curve open_circuit_voltage_;
  Curve resistance_;
  std::array<robot::BatteryBranch, 2> branches_{};  // absent ones without resistance
  std::array<robot::ChargeLag, 2> lags_{};          // absent ones without lag
  double resistance_at_half_ohm_;
  double capacity_ah_;
  double cutoff_voltage_v_;
  double reserve_fraction_;
  double coulombic_efficiency_;
  double activation_k_;
  double thermal_resistance_k_w_;
  double thermal_time_constant_s_;  // infinite without thermal parameters
  bool typical_curve_;
};

}  // namespace joulecast::battery
