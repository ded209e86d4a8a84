#pragma once

#include <cmath>

namespace joulecast::virtual_robot {

// Dry friction as a bristle that bends before it slips (Canudas de Wit, Olsson, Astrom and Lischinsky 1995,
// LuGre), scaled so that |bend| = 1 is plain Coulomb sliding and the level may change on the way:
//   d bend/dt = (w - |w| bend / g(w)) / delta,  g(w) = 1 + s exp(-(|w|/w_s)^p),  T = level (bend + k_d d
//   bend/dt)
// delta [rad] is the wheel angle over which the bristle bends, w_s [rad/s] the Stribeck speed,
// p = 1 (as here unless given) or 2 as in much of the literature.
struct Bristle {
  static constexpr double damping_s = 0.004;
  static constexpr double damping_speed_rad_s = 0.05;  // beyond it the damping fades, or braking would jerk

  double bend_angle_rad = 0.006;
  double stribeck_fraction = 0;
  double stribeck_speed_rad_s = 1;
  double stribeck_power = 1;

  double bend_rate(double bend, double speed_rad_s) const {
    const double magnitude = std::abs(speed_rad_s);
    double slip_level = 1;
    if (stribeck_fraction != 0) {
      slip_level += stribeck_fraction * std::exp(-std::pow(magnitude / stribeck_speed_rad_s, stribeck_power));
    }
    return (speed_rad_s - magnitude * bend / slip_level) / bend_angle_rad;
  }

  // Torque against the motion over the friction level.
  static double torque_ratio(double bend, double bend_rate_1_s, double speed_rad_s) {
    const double fade = speed_rad_s / damping_speed_rad_s;
    return bend + damping_s / (1 + fade * fade) * bend_rate_1_s;
  }
};

}  // namespace joulecast::virtual_robot
