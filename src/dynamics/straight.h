#pragma once

#include <array>

#include "robot/robot_model.h"

namespace joulecast::dynamics {

// Power of a motion along one coordinate x with speed w and acceleration a, thesis (4-1):
//   P(a, w) = c1 a^2 + cx a w + ca a + c2 w^2 + c3 w + c0,  w >= 0.
// The coordinate is the caller's: wheel angle [rad], distance [m] or heading [rad].
struct QuadraticPower {
  double c1 = 0;  // W s^4/x^2
  double cx = 0;  // W s^3/x^2
  double ca = 0;  // W s^2/x
  double c2 = 0;  // W s^2/x^2
  double c3 = 0;  // W s/x
  double c0 = 0;  // W

  double power_w(double speed, double acceleration) const {
    return (c1 * acceleration + cx * speed + ca) * acceleration + (c2 * speed + c3) * speed + c0;
  }

  // The same power over the coordinate y = scale * x.
  QuadraticPower rescaled(double scale) const {
    const double s = 1 / scale;
    return {c1 * s * s, cx * s * s, ca * s, c2 * s * s, c3 * s, c0};
  }

  QuadraticPower& operator+=(const QuadraticPower& b) {
    c1 += b.c1, cx += b.cx, ca += b.ca, c2 += b.c2, c3 += b.c3, c0 += b.c0;
    return *this;
  }
};

// One wheel with a motor torque T = inertia a + damping w + friction [N m] at the wheel:
// P = rho T^2 + kappa w T with rho = R/(K_t n)^2 and kappa = K_w/K_t (thesis, motion on a straight line).
QuadraticPower wheel_power(double rho_w_n2_m2, double kappa, double inertia_kg_m2, double damping_nm_s_rad,
                           double friction_nm);

// Electrical power of the motors on a straight line, over the wheel angle [rad], idle power left out.
// Thesis (3-2), (3-3) for each side and (4-1) for `both`, with J = I_w + I_s + m r^2/2; the term in a^2 m_p^2
// that the thesis drops is included. Without the effects of the robot file; the planner uses the drive model.
struct StraightPower {
  std::array<QuadraticPower, 2> side;
  QuadraticPower both;
  double wheel_radius_m = 0;

  QuadraticPower over_distance() const { return both.rescaled(wheel_radius_m); }
};

StraightPower straight_power(const robot::RobotModel& robot, double payload_kg);

}  // namespace joulecast::dynamics
