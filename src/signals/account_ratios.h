#pragma once

#include <limits>

#include "signals/ledger.h"

// Two figures by which missions and sums of missions are compared.
namespace joulecast::signals {

// Measured over modelled energy of the measured time; NaN without any, or where the modelled is not above 0.
inline double energy_ratio(const Accounts& a) {
  const double modelled_j = a.measured_j - a.ledger[Term::unexplained];
  return a.measured_s > 0 && modelled_j > 0 ? a.measured_j / modelled_j
                                            : std::numeric_limits<double>::quiet_NaN();
}

inline constexpr double least_compared_distance_m = 0.1;

// Battery energy a distance, Wh/km; NaN below least_compared_distance_m.
inline double energy_per_distance_wh_km(const Accounts& a) {
  return a.distance_m > least_compared_distance_m ? a.battery_j / a.distance_m / 3.6
                                                  : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace joulecast::signals
