#pragma once

#include <cmath>

namespace joulecast::dynamics {

// A number with its derivative along one direction: forward-mode differentiation of the drive model with
// respect to one parameter of one effect. Comparisons look at the value only.
struct Dual {
  double value = 0;
  double slope = 0;

  constexpr Dual() = default;
  constexpr Dual(double v, double d = 0) : value(v), slope(d) {}  // NOLINT: plain numbers mix freely

  constexpr Dual& operator+=(Dual b) { return *this = {value + b.value, slope + b.slope}; }
  constexpr Dual& operator-=(Dual b) { return *this = {value - b.value, slope - b.slope}; }
  constexpr Dual& operator*=(Dual b) { return *this = {value * b.value, slope * b.value + value * b.slope}; }
  constexpr Dual& operator/=(Dual b) {
    return *this = {value / b.value, (slope - value / b.value * b.slope) / b.value};
  }
  friend constexpr Dual operator+(Dual a, Dual b) { return a += b; }
  friend constexpr Dual operator-(Dual a, Dual b) { return a -= b; }
  friend constexpr Dual operator*(Dual a, Dual b) { return a *= b; }
  friend constexpr Dual operator/(Dual a, Dual b) { return a /= b; }
  friend constexpr Dual operator-(Dual a) { return {-a.value, -a.slope}; }
  friend constexpr bool operator<(Dual a, Dual b) { return a.value < b.value; }
  friend constexpr bool operator>(Dual a, Dual b) { return a.value > b.value; }
};

inline Dual sqrt(Dual a) {
  const double root = std::sqrt(a.value);
  return {root, a.slope / (2 * root)};
}
inline Dual exp(Dual a) {
  const double e = std::exp(a.value);
  return {e, e * a.slope};
}
inline Dual log(Dual a) {
  return {std::log(a.value), a.slope / a.value};
}
inline Dual sin(Dual a) {
  return {std::sin(a.value), std::cos(a.value) * a.slope};
}
inline Dual cos(Dual a) {
  return {std::cos(a.value), -std::sin(a.value) * a.slope};
}
inline Dual tanh(Dual a) {
  const double t = std::tanh(a.value);
  return {t, (1 - t * t) * a.slope};
}
inline Dual abs(Dual a) {
  return a.value < 0 ? -a : a;
}

inline double abs(double a) {
  return std::fabs(a);
}
inline double value_of(double a) {
  return a;
}
inline double value_of(Dual a) {
  return a.value;
}

using std::cos;
using std::exp;
using std::log;
using std::sin;
using std::sqrt;
using std::tanh;

// x / sqrt(x^2 + width^2): +1 or -1 for |x| >> width, smooth in between. Dry friction uses it for its
// direction, so that friction vanishes at standstill and forward simulation stays differentiable.
template <class S>
S smooth_sign(S x, double width) {
  return x / sqrt(x * x + S(width * width));
}

}  // namespace joulecast::dynamics
