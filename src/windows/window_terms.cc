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
  std::array<double, 5> terms{1, 0, 0, 0, 0};
  const double climb = std::isfinite(w.climb_rad) ? std::sin(w.climb_rad) : 0;
  const auto add = [&](double weight, const std::array<double, 2>& wheels,
                       const std::array<double, 2>& rates) {
    const double speed = 0.5 * wheel_radius_m * (wheels[0] + wheels[1]);
    terms[1] += weight * std::fabs(speed);
    terms[2] += weight * std::fabs(wheel_radius_m * (wheels[0] - wheels[1]));
    terms[3] += weight * speed * 0.5 * wheel_radius_m * (rates[0] + rates[1]);
    terms[4] += weight * speed * climb;
  };
  if (!w.reading) {
    add(1, w.speed_rad_s, w.acceleration_rad_s2);
    return terms;
  }
  for (std::size_t part = 0; part < w.part_weight.size(); ++part)
    add(w.part_weight[part], w.part_speed_rad_s[part], w.part_acceleration_rad_s2[part]);
  return terms;
}

}  // namespace joulecast::windows
