#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

namespace joulecast::signals {

// Where battery energy goes. Energy leaving the battery is positive, and over any span
//   battery = sum over terms of sign(term) * energy[term],
// sign being -1 for `recovered` and +1 for the others. `kinetic` and `potential` are signed changes of stored
// energy.
enum class Term : std::size_t {
  accessories,        // idle power and other constant loads
  driver,             // losses of the motor drivers
  copper,             // R i^2 in the windings
  brush,              // brush drop times current
  friction_internal,  // inside motors and gears: T_m, viscous, gear loss
  friction_rolling,   // between wheels and floor, driving
  friction_scrub,     // between wheels and floor, turning
  friction_zone,      // extra rolling resistance of a region of the floor
  friction_slip,      // wheel travel without motion of the body
  drag,               // air
  kinetic,            // change of translational, yaw, wheel and rotor energy
  potential,          // change of height
  braking,            // electrical energy that the motors generate while braking
  recovered,          // the part of `braking` that reaches the battery
  sensor,             // part of the reading from an adopted sensor fault
  unexplained         // measured minus modelled, integrated on its own
};
inline constexpr std::size_t term_count = 16;

inline constexpr std::array<std::string_view, term_count> term_names = {
    "accessories",    "driver",        "copper",        "brush",      "friction_internal", "friction_rolling",
    "friction_scrub", "friction_zone", "friction_slip", "drag",       "kinetic",           "potential",
    "braking",        "recovered",     "sensor",        "unexplained"};

constexpr double sign(Term term) {
  return term == Term::recovered ? -1.0 : 1.0;
}

// One value a term: watts where it holds rates, joules where it holds energies. S: double, or a dual number.
template <class S>
struct BasicLedger {
  std::array<S, term_count> value{};

  S& operator[](Term term) { return value[static_cast<std::size_t>(term)]; }
  const S& operator[](Term term) const { return value[static_cast<std::size_t>(term)]; }

  // The signed sum, equal to the energy that leaves the battery.
  S total() const {
    S sum = 0;
    for (std::size_t k = 0; k < term_count; ++k) sum += sign(static_cast<Term>(k)) * value[k];
    return sum;
  }
};

using Ledger = BasicLedger<double>;

// The accounts of one mission or one span of it, in joules unless the name ends in another unit.
struct Accounts {
  double battery_j = 0;   // measured where measured, modelled elsewhere; the ledger adds up to it
  double measured_j = 0;  // at the battery terminals, over the `measured_s` that were measured
  double measured_s = 0;
  std::array<double, 2>
      measured_motor_j{};  // V i of each motor, over the `motor_measured_s` that were measured
  double motor_measured_s = 0;
  double modelled_j = 0;  // at the battery terminals, from the measured motion
  std::array<double, 2> modelled_motor_j{};
  double drawn_j = 0;     // of battery_j, while power flows out
  double returned_j = 0;  // of battery_j, while power flows in, >= 0
  double charge_ah = 0;   // net charge out of the battery
  double distance_m = 0;  // path travelled, >= 0
  double turned_rad = 0;  // heading travelled, >= 0
  double duration_s = 0;
  Ledger ledger;
};

// Measured over modelled energy of the measured time; NaN without any, or where the modelled is not above 0.
// Missions and sums of missions are compared by this and by the energy a distance.
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
