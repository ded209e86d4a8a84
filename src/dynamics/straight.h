#pragma once

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

  QuadraticPower& operator+=(const QuadraticPower& b) {
    c1 += b.c1, cx += b.cx, ca += b.ca, c2 += b.c2, c3 += b.c3, c0 += b.c0;
    return *this;
  }
};

// One wheel with a motor torque T = inertia a + damping w + friction [N m] at the wheel:
// P = rho T^2 + kappa w T with rho = R/(K_t n)^2 and kappa = K_w/K_t (thesis, motion on a straight line).
inline QuadraticPower wheel_power(double rho, double kappa, double inertia, double damping, double friction) {
  return {rho * inertia * inertia,
          2 * rho * inertia * damping + kappa * inertia,
          2 * rho * inertia * friction,
          rho * damping * damping + kappa * damping,
          2 * rho * damping * friction + kappa * friction,
          rho * friction * friction};
}

}  // namespace joulecast::dynamics
