#include "gap/equations/ranges.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {

Ranges ranges_of(std::span<const Window> windows, const robot::RobotModel& robot) {
  Ranges r;
  r.wheel_radius_m = robot.kinematics.wheel_radius_m;
  r.half_track_m = robot.kinematics.half_track_m;
  r.idle_power_w = robot.idle_power_w;
  double payload_low = 1e300, payload_high = 0;
  double x_low = 1e300, x_high = -1e300, y_low = 1e300, y_high = -1e300;
  double power = 0, with_power = 0, motors = 0, with_motors = 0, wheels = 0;
  Ranges most;
  most.speed_m_s = most.wheel_speed_rad_s = most.acceleration_m_s2 = most.yaw_rate_rad_s = most.current_a =
      most.battery_current_a = 0;
  const auto raise = [](double& to, double value) {
    if (std::isfinite(value)) to = std::max(to, std::fabs(value));
  };
  for (const Window& w : windows) {
    raise(most.speed_m_s, 0.5 * r.wheel_radius_m * (w.speed_rad_s[0] + w.speed_rad_s[1]));
    raise(most.acceleration_m_s2,
          0.5 * r.wheel_radius_m * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]));
    raise(most.yaw_rate_rad_s,
          r.wheel_radius_m * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * r.half_track_m));
    for (const std::size_t s : {0u, 1u}) {
      raise(most.wheel_speed_rad_s, w.speed_rad_s[s]);
      raise(most.current_a, w.current_a[s]);
      wheels += 0.5 * std::fabs(w.speed_rad_s[s]);
    }
    raise(most.battery_current_a, w.battery_current_a);
    raise(r.battery_voltage_step_v, w.battery_voltage_step_v);
    raise(r.duration_s, w.t_s);
    payload_low = std::min(payload_low, w.payload_kg);
    payload_high = std::max(payload_high, w.payload_kg);
    if (std::isfinite(w.battery_power_w)) power += std::fabs(w.battery_power_w), ++with_power;
    if (const double p = w.motor_power_w[0] + w.motor_power_w[1]; std::isfinite(p))
      motors += std::fabs(p + robot.idle_power_w), ++with_motors;
    if (std::isfinite(w.x_m + w.y_m)) {
      x_low = std::min(x_low, w.x_m);
      x_high = std::max(x_high, w.x_m);
      y_low = std::min(y_low, w.y_m);
      y_high = std::max(y_high, w.y_m);
      r.position = true;
    }
    if (std::isfinite(w.heading_rad)) r.heading = true;
    if (std::fabs(w.climb_rad) > 0) r.climb = true;
  }
  const auto or_one = [](double v) { return v > 0 ? v : 1.0; };
  r.speed_m_s = or_one(most.speed_m_s);
  r.wheel_speed_rad_s = or_one(most.wheel_speed_rad_s);
  r.acceleration_m_s2 = or_one(most.acceleration_m_s2);
  r.yaw_rate_rad_s = or_one(most.yaw_rate_rad_s);
  r.current_a = or_one(most.current_a);
  r.battery_current_a = or_one(most.battery_current_a);
  r.payload_kg = or_one(payload_high);
  r.payload_varies = payload_high > payload_low + 1e-3 * payload_high;
  r.power = with_power + with_motors > 0;
  if (r.power) {
    r.mean_power_w = std::max(with_power > 0 ? power / with_power : motors / with_motors, 1e-3);
  } else {
    const dynamics::DriveModel model(robot, {});
    double modelled = 0;
    for (const Window& w : windows) modelled += std::fabs(metered_power(model, w));
    r.mean_power_w = std::max(modelled / static_cast<double>(std::max<std::size_t>(1, windows.size())), 1e-3);
  }
  r.mean_wheel_speed_rad_s = windows.empty() ? 0 : wheels / static_cast<double>(windows.size());
  if (r.position) {
    r.x_low_m = x_low;
    r.x_high_m = std::max(x_high, x_low + 0.5);
    r.y_low_m = y_low;
    r.y_high_m = std::max(y_high, y_low + 0.5);
  }
  return r;
}

}  // namespace joulecast::gap
