#pragma once

#include <random>

#include "dynamics/motion.h"

namespace joulecast::testing {

// A motion anywhere in a robot's envelope: driving, braking, turning, both directions.
inline dynamics::Instant random_motion(std::mt19937& random) {
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  dynamics::Instant at;
  at.wheel_speed_rad_s = {between(-9, 9), between(-9, 9)};
  at.wheel_acceleration_rad_s2 = {between(-4, 4), between(-4, 4)};
  at.payload_kg = between(0.5, 10);
  at.x_m = between(-3, 3);
  at.y_m = between(-3, 3);
  at.heading_rad = between(-7, 7);
  at.current_slope_a_s = {between(-5, 5), between(-5, 5)};
  at.copper_heat_w = {between(0, 20), between(0, 20)};
  at.climb_rad = between(-0.1, 0.1);
  return at;
}

}  // namespace joulecast::testing
