#pragma once

#include <cmath>

#include "dynamics/dual.h"

namespace joulecast::dynamics {

// The remaining share of breakaway friction at a speed x over the Stribeck speed: exp(-|x|^exponent), rounded
// off within a hundredth of the Stribeck speed so that every derivative is finite. Armstrong-Helouvry,
// Control of Machines with Friction, 1991, ch. 2: exponents of 1 and 2 are both found.
inline constexpr double stribeck_rounding = 1e-4;

template <class S>
S stribeck_curve(const S& x, const S& exponent) {
  return exp(S(-1) * exp(S(0.5) * exponent * log(x * x + S(stribeck_rounding))));
}

// The same with its first and second derivative by x.
struct StribeckSlopes {
  double value, first, second;
};

inline StribeckSlopes stribeck_slopes(double x, double exponent) {
  const double z = x * x + stribeck_rounding, u = std::pow(z, 0.5 * exponent), steep = exponent * u / z;
  const double u1 = steep * x, u2 = steep * (1 + (exponent - 2) * x * x / z), value = std::exp(-u);
  return {value, -u1 * value, (u1 * u1 - u2) * value};
}

}  // namespace joulecast::dynamics
