#pragma once

#include <array>
#include <limits>

#include "dynamics/parameters.h"

namespace joulecast::dynamics {

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// The state of motion at one instant, as the robot's encoders and map see it. Sides: [0] right, [1] left.
struct Instant {
  std::array<double, 2> wheel_speed_rad_s{};
  std::array<double, 2> wheel_acceleration_rad_s2{};
  double payload_kg = 0;  // declared
  double x_m = unknown;   // unknown position: effects tied to the floor have no effect
  double y_m = unknown;
  double heading_rad = unknown;
  double climb_rad = unknown;                 // of the floor along the heading, nose up positive (climb.h)
  std::array<double, 2> current_slope_a_s{};  // di/dt of the armature, for the inductance effect
  std::array<double, 2> copper_heat_w{};      // R i^2 low-passed with the thermal time constant
};

// The same motion of the body. `speed`: of the axle's middle, forward; `yaw_rate`: to the left.
template <class S>
struct Body {
  S speed_m_s = 0;
  S yaw_rate_rad_s = 0;
  S acceleration_m_s2 = 0;
  S yaw_acceleration_rad_s2 = 0;
};

// v = (r1 w1 + r2 w2)/2, yaw = (r1 w1 - r2 w2)/(2l), thesis (2-4), (2-6), with each wheel's radius and slip.
template <class S>
Body<S> body_of_wheels(const Parameters<S>& p, const std::array<double, 2>& speed,
                       const std::array<double, 2>& acceleration) {
  const S grip = S(1) - p.slip;
  const S right = p.wheel_radius_m[0] * grip, left = p.wheel_radius_m[1] * grip;
  Body<S> body;
  body.speed_m_s = (right * speed[0] + left * speed[1]) * 0.5;
  body.acceleration_m_s2 = (right * acceleration[0] + left * acceleration[1]) * 0.5;
  body.yaw_rate_rad_s = (right * speed[0] - left * speed[1]) / (2.0 * p.half_track_m);
  body.yaw_acceleration_rad_s2 = (right * acceleration[0] - left * acceleration[1]) / (2.0 * p.half_track_m);
  return body;
}

// The inverse of body_of_wheels for speeds and, being linear, for accelerations: w = (v +- l yaw)/r, thesis
// (2-49) with l half the track (the printed 2l is a misprint).
inline std::array<double, 2> wheels_of_body(const Parameters<double>& p, double speed_m_s,
                                            double yaw_rate_rad_s) {
  const double grip = 1 - p.slip;
  return {(speed_m_s + p.half_track_m * yaw_rate_rad_s) / (p.wheel_radius_m[0] * grip),
          (speed_m_s - p.half_track_m * yaw_rate_rad_s) / (p.wheel_radius_m[1] * grip)};
}

}  // namespace joulecast::dynamics
