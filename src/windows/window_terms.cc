#include <algorithm>
#include <cmath>

#include "windows/windows.h"

namespace joulecast::windows {

bool steady(const Window& w) {
  return (w.moving[0] || w.resting[0]) && (w.moving[1] || w.resting[1]);
}

dynamics::Instant instant_of(const Window& w) {
  dynamics::Instant at;
  at.wheel_speed_rad_s = w.speed_rad_s;
  at.wheel_acceleration_rad_s2 = w.acceleration_rad_s2;
  at.payload_kg = w.payload_kg;
  at.x_m = w.x_m;
  at.y_m = w.y_m;
  at.heading_rad = w.heading_rad;
  at.climb_rad = w.climb_rad;
  return at;
}

std::array<double, 5> plain_terms(const Window& w, double wheel_radius_m) {
  const double speed = 0.5 * wheel_radius_m * (w.speed_rad_s[0] + w.speed_rad_s[1]);
  const double difference = wheel_radius_m * (w.speed_rad_s[0] - w.speed_rad_s[1]);
  const double acceleration = 0.5 * wheel_radius_m * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  return {1.0, std::fabs(speed), std::fabs(difference), speed * acceleration,
          std::isfinite(w.climb_rad) ? speed * std::sin(w.climb_rad) : 0};
}

}  // namespace joulecast::windows
