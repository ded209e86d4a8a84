#pragma once

#include <vector>

#include "battery/circuit.h"

namespace joulecast::forecast {

// Energy at the terminals against charge, for one mean power. Between charges a and b a battery holds
// 3600 C integral U(s) ds; of it the terminals give the share V/U, V being the voltage under the mean power
// with all branches settled. The ripple of the power about its mean costs r (<I^2> - <I>^2) more, which is
// neglected (below 0.5 % of the energy where r I is below 1 % of U), and V/U is taken at the charge where the
// draw begins.
class ChargeMap {
 public:
  explicit ChargeMap(const battery::Circuit& circuit);

  double reserve_fraction() const { return circuit_.reserve_fraction(); }
  const battery::Circuit& circuit() const { return circuit_; }

  // From one charge down to another [J]; negative when `to` is above `from`.
  double energy_j(double from, double to, double mean_power_w) const;
  // Charge after so much energy left; may be below 0.
  double charge_after(double from, double energy_j, double mean_power_w) const;
  // Charge at which the terminals under this power reach the cut-off voltage; 0 when they hold it to the end.
  double cutoff_charge(double mean_power_w) const;
  // Standard deviation of energy over that of the same charge, relative: of the curve's voltage, and of the
  // map's approximations.
  double relative_deviation() const { return circuit_.typical_curve() ? 0.008 : 0.004; }
  // d energy / d charge at a charge [J].
  double slope_j(double charge, double mean_power_w) const;

 private:
  double share(double charge, double mean_power_w) const;  // V/U
  double stored_j(double charge) const;                    // from empty

  battery::Circuit circuit_;
  std::vector<double> stored_j_;  // at charges k / (size - 1)
};

}  // namespace joulecast::forecast
