#include "gap/equations/families.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {
namespace {

using windows::motion_time_constants_s;

constexpr std::size_t grid_side = 5;  // radial functions a side of the floor

double speed_of(const Window& w, const Ranges& r) {
  return r.wheel_radius_m * 0.5 * (w.speed_rad_s[0] + w.speed_rad_s[1]) / r.speed_m_s;
}
double acceleration_of(const Window& w, const Ranges& r) {
  return r.wheel_radius_m * 0.5 * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]) / r.acceleration_m_s2;
}
double yaw_of(const Window& w, const Ranges& r) {
  return r.wheel_radius_m * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * r.half_track_m) / r.yaw_rate_rad_s;
}
double direction(const Window& w, std::size_t s) {
  return w.resting[s] ? 0.0 : std::copysign(1.0, w.speed_rad_s[s]);
}

void decays(double t_s, const Ranges& r, double factor, std::span<double> out) {
  out[0] = factor * std::exp(-t_s / 5);
  out[1] = factor * std::exp(-t_s / 20);
  out[2] = factor * std::exp(-t_s / 80);
  out[3] = factor * (t_s / r.duration_s - 0.5);
}

void recent_motion(const Window& w, const Ranges& r, double factor, std::span<double> out) {
  for (std::size_t k = 0; k < w.recent_rad_s.size(); ++k)
    out[k] = factor * w.recent_rad_s[k] / r.wheel_speed_rad_s;
}

void positions(const Window& w, const Ranges& r, double factor, std::span<double> out) {
  const double width_x = (r.x_high_m - r.x_low_m) / (grid_side - 1),
               width_y = (r.y_high_m - r.y_low_m) / (grid_side - 1);
  for (std::size_t k = 0; k < grid_side * grid_side; ++k) {
    const double x = r.x_low_m + width_x * static_cast<double>(k % grid_side);
    const double y = r.y_low_m + width_y * static_cast<double>(k / grid_side);
    const double u = (w.x_m - x) / width_x, v = (w.y_m - y) / width_y;
    out[k] = std::isfinite(u + v) ? factor * std::exp(-0.7 * (u * u + v * v)) : 0.0;
  }
}

void headings(const Window& w, double factor, std::span<double> out) {
  const double h = std::isfinite(w.heading_rad) ? w.heading_rad : 0.0;
  out[0] = factor * std::cos(h);
  out[1] = factor * std::sin(h);
  out[2] = factor * std::cos(2 * h);
  out[3] = factor * std::sin(2 * h);
}

// Torque at a wheel.
void torque_speed(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  const double u = std::fabs(w.speed_rad_s[s]) / r.wheel_speed_rad_s, d = direction(w, s);
  out[0] = d * u;
  out[1] = d * u * u;
  out[2] = d * u * u * u;
  out[3] = d * std::exp(-u * u / 0.01);
  out[4] = d * std::exp(-u * u / 0.06);
}
void torque_acceleration(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  const double a = acceleration_of(w, r), d = direction(w, s);
  out[0] = d * std::fabs(a);
  out[1] = a * std::fabs(a);
  out[2] = d * a * a;
}
void torque_yaw(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  const double y = yaw_of(w, r), d = direction(w, s), side = s == 0 ? 1.0 : -1.0;
  out[0] = side * y;
  out[1] = side * y * std::fabs(y);
  out[2] = d * std::fabs(y);
  out[3] = d * y * y;
  out[4] = d * speed_of(w, r) * y;
}
void torque_payload(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  const double p = w.payload_kg / r.payload_kg, d = direction(w, s),
               u = std::fabs(w.speed_rad_s[s]) / r.wheel_speed_rad_s;
  out[0] = d * p * p;
  out[1] = d * p * u;
  out[2] = d * p * u * u;
}
void torque_time(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  decays(w.t_s, r, direction(w, s), out);
}
void torque_recent_motion(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  recent_motion(w, r, direction(w, s), out);
}
void torque_heading(const Window& w, const Ranges&, std::size_t s, std::span<double> out) {
  headings(w, direction(w, s), out);
}
void torque_position(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  positions(w, r, direction(w, s), out);
}

// Electrical load.
void load_speed(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  const double u = std::fabs(speed_of(w, r)), rest = w.resting[0] && w.resting[1] ? 1.0 : 0.0;
  out[0] = rest;
  out[1] = u;
  out[2] = u * u;
  out[3] = u * u * u;
}
void load_acceleration(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  const double a = acceleration_of(w, r);
  out[0] = std::fabs(a);
  out[1] = a * a;
  out[2] = std::max(0.0, a);
}
void load_yaw(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  const double y = yaw_of(w, r);
  out[0] = std::fabs(y);
  out[1] = y * y;
  out[2] = y;
}
void load_payload(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  const double p = w.payload_kg / r.payload_kg;
  out[0] = p;
  out[1] = p * p;
}
void load_time(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  decays(w.t_s, r, 1.0, out);
}
void load_recent_motion(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  recent_motion(w, r, 1.0, out);
}
void load_heading(const Window& w, const Ranges&, std::size_t, std::span<double> out) {
  headings(w, 1.0, out);
}
void load_position(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  positions(w, r, 1.0, out);
}
void load_battery(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  // By the motors' power: the battery's own reading would carry the noise of what it is compared with.
  out[0] = (r.idle_power_w + w.motor_power_w[0] + w.motor_power_w[1]) /
           (r.battery_current_a * w.mission_voltage_v);
}
void power_heading(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  headings(w, 1.0, out);
  const double v = std::fabs(speed_of(w, r));
  out[4] = v * out[2];
  out[5] = v * out[3];
}

// Voltage of a motor.
void voltage_speed(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  const double u = w.speed_rad_s[s] / r.wheel_speed_rad_s;
  out[0] = u * std::fabs(u);
  out[1] = u * u * u;
}
void voltage_current(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  const double i = w.current_a[s] / r.current_a;
  out[0] = i * std::fabs(i);
  out[1] = i * i * i;
}
void voltage_time(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  decays(w.t_s, r, w.current_a[s] / r.current_a, out);
}
void voltage_drift(const Window& w, const Ranges& r, std::size_t s, std::span<double> out) {
  decays(w.t_s, r, w.speed_rad_s[s] / r.wheel_speed_rad_s, out);
}

// Kinematics.
void yaw_speed(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  const double y = yaw_of(w, r), v = speed_of(w, r);
  out[0] = y * std::fabs(y);
  out[1] = y * std::fabs(v);
  out[2] = v * std::fabs(v);
}
void travel_speed(const Window& w, const Ranges& r, std::size_t, std::span<double> out) {
  const double v = speed_of(w, r), p = w.payload_kg / r.payload_kg;
  out[0] = v * std::fabs(v);
  out[1] = v * p;
  out[2] = v * std::fabs(yaw_of(w, r));
}

}  // namespace

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

std::vector<OutsideFamily> outside_families(const Ranges& ranges, const FromMotion& from_motion) {
  constexpr auto torque_right = Channel::torque_right, voltage_right = Channel::voltage_right;
  constexpr auto gyro = Channel::gyro, travel = Channel::travel;
  const bool power = from_motion.power;
  const Channel load = power ? Channel::power : Channel::bus;
  constexpr std::size_t cells = grid_side * grid_side;
  std::vector<OutsideFamily> families{
      {"speed", torque_right, 5, torque_speed},
      {"acceleration", torque_right, 3, torque_acceleration},
      {"yaw_rate", torque_right, 5, torque_yaw},
      {"time", torque_right, 4, torque_time},
      {"recent_motion", torque_right, motion_time_constants_s.size(), torque_recent_motion},
      {"recent_motion", load, motion_time_constants_s.size(), load_recent_motion},
      {"speed", load, 4, load_speed},
      {"acceleration", load, 3, load_acceleration},
      {"yaw_rate", load, 3, load_yaw},
      {"time", load, 4, load_time},
      {"speed", voltage_right, 2, voltage_speed},
      {"current", voltage_right, 2, voltage_current},
      {"time", voltage_right, 4, voltage_time},
      {"time", voltage_right, 4, voltage_drift},
  };
  if (from_motion.kinematics) {
    families.push_back({"speed", gyro, 3, yaw_speed});
    families.push_back({"speed", travel, 3, travel_speed});
  }
  if (!power) families.push_back({"battery_current", load, 1, load_battery});
  if (ranges.payload_varies) {
    families.push_back({"payload", torque_right, 3, torque_payload});
    families.push_back({"payload", load, 2, load_payload});
  }
  if (ranges.heading) {
    families.push_back({"heading", torque_right, 4, torque_heading});
    if (power) {
      families.push_back({"heading", load, 6, power_heading});
    } else {
      families.push_back({"heading", load, 4, load_heading});
    }
  }
  if (ranges.position) {
    families.push_back({"position", torque_right, cells, torque_position});
    families.push_back({"position", load, cells, load_position});
  }
  return families;
}

}  // namespace joulecast::gap
