#pragma once

#include <cmath>

namespace joulecast::oracle {

// A value with its first and second derivatives by two variables.
struct Jet {
  double f = 0, g0 = 0, g1 = 0, h00 = 0, h01 = 0, h11 = 0;

  Jet() = default;
  Jet(double value) : f(value) {}
  static Jet first(double value) {
    Jet j(value);
    j.g0 = 1;
    return j;
  }
  static Jet second(double value) {
    Jet j(value);
    j.g1 = 1;
    return j;
  }
};

// y(a) by the slope and the bend of y.
inline Jet chain(const Jet& a, double value, double slope, double bend) {
  Jet r;
  r.f = value;
  r.g0 = slope * a.g0, r.g1 = slope * a.g1;
  r.h00 = slope * a.h00 + bend * a.g0 * a.g0;
  r.h01 = slope * a.h01 + bend * a.g0 * a.g1;
  r.h11 = slope * a.h11 + bend * a.g1 * a.g1;
  return r;
}

inline Jet operator+(const Jet& a, const Jet& b) {
  Jet r;
  r.f = a.f + b.f, r.g0 = a.g0 + b.g0, r.g1 = a.g1 + b.g1;
  r.h00 = a.h00 + b.h00, r.h01 = a.h01 + b.h01, r.h11 = a.h11 + b.h11;
  return r;
}

inline Jet operator*(const Jet& a, const Jet& b) {
  Jet r;
  r.f = a.f * b.f, r.g0 = a.f * b.g0 + a.g0 * b.f, r.g1 = a.f * b.g1 + a.g1 * b.f;
  r.h00 = a.f * b.h00 + 2 * a.g0 * b.g0 + a.h00 * b.f;
  r.h01 = a.f * b.h01 + a.g0 * b.g1 + a.g1 * b.g0 + a.h01 * b.f;
  r.h11 = a.f * b.h11 + 2 * a.g1 * b.g1 + a.h11 * b.f;
  return r;
}

inline Jet operator-(const Jet& a, const Jet& b) {
  return a + Jet(-1) * b;
}

inline Jet inverse(const Jet& a) {
  const double i = 1 / a.f;
  return chain(a, i, -i * i, 2 * i * i * i);
}

inline double inverse(double a) {
  return 1 / a;
}

inline Jet tanh(const Jet& a) {
  const double y = std::tanh(a.f), slope = 1 - y * y;
  return chain(a, y, slope, -2 * y * slope);
}

// sqrt(a^2 + width^2), which is |a| but near 0.
inline Jet soft_abs(const Jet& a, double width) {
  const double y = std::hypot(a.f, width);
  return chain(a, y, a.f / y, width * width / (y * y * y));
}

inline double soft_abs(double a, double width) {
  return std::hypot(a, width);
}

inline double value_of(const Jet& a) {
  return a.f;
}
inline double value_of(double a) {
  return a;
}

}  // namespace joulecast::oracle
