#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace joulecast::planning {

// Gauss-Legendre rules on [0, 1] (Abramowitz & Stegun, table 25.4): where to look, and its weight.
struct GaussNode {
  double at, weight;
};
inline constexpr std::array<GaussNode, 2> gauss2{{{0.21132486540518713, 0.5}, {0.7886751345948129, 0.5}}};
inline constexpr std::array<GaussNode, 3> gauss3{
    {{0.1127016653792583, 5.0 / 18}, {0.5, 8.0 / 18}, {0.8872983346207417, 5.0 / 18}}};
inline constexpr std::array<GaussNode, 4> gauss4{{{0.06943184420297371, 0.17392742256872692},
                                                  {0.33000947820757187, 0.32607257743127307},
                                                  {0.6699905217924281, 0.32607257743127307},
                                                  {0.9305681557970263, 0.17392742256872692}}};

// A zero of `f` between `low` (f < 0) and `high` (f > 0): bisection hastened by inverse quadratic steps
// (Chandrupatla 1997), until the bracket is within `relative` of the argument plus `absolute`.
template <class F>
double zero_between(F&& f, double low, double f_low, double high, double f_high, double relative = 1e-14,
                    double absolute = 0) {
  double a = high, fa = f_high, b = low, fb = f_low, c = a, fc = fa, t = 0.5;
  for (int k = 0; k < 100; ++k) {
    const double x = a + t * (b - a), fx = f(x);
    if ((fx < 0) == (fa < 0)) {
      c = a, fc = fa;
    } else {
      c = b, b = a, fc = fb, fb = fa;
    }
    a = x, fa = fx;
    const double best = std::fabs(fa) < std::fabs(fb) ? a : b;
    const double tolerance = relative * std::fabs(best) + absolute;
    const double edge = tolerance / std::fabs(b - c);
    if (edge > 0.5 || fa == 0) return best;
    const double xi = (a - b) / (c - b), phi = (fa - fb) / (fc - fb);
    const bool quadratic = phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi;
    t = quadratic ? fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
                  : 0.5;
    t = std::clamp(t, edge, 1 - edge);
  }
  return a;
}

// The last place between `low`, where `holds` does, and `high`, where it does not, by bisection.
template <class Predicate>
double last_that(Predicate&& holds, double low, double high, int halvings) {
  for (int k = 0; k < halvings; ++k) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? low : high) = middle;
  }
  return low;
}

}  // namespace joulecast::planning
