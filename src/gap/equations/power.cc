#include "gap/equations/power.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {

bool voltages_read(std::span<const Window> windows) {
  return std::ranges::any_of(windows, [](const Window& w) {
    return std::isfinite(w.voltage_v[0]) || std::isfinite(w.voltage_v[1]);
  });
}

double motor_voltage(const Window& w, const robot::RobotModel& robot, std::size_t s) {
  if (std::isfinite(w.voltage_v[s])) return w.voltage_v[s];
  const robot::Motor& m = robot.motor;
  return m.resistance_ohm * w.current_a[s] + m.voltage_constant_v_s_rad * m.gear_ratio * w.speed_rad_s[s];
}

double motors_power(const Window& w, const robot::RobotModel& robot, bool volts_read) {
  const auto motor = [&](std::size_t s) {
    return volts_read ? w.motor_power_w[s] : w.current_a[s] * motor_voltage(w, robot, s);
  };
  return motor(0) + motor(1);
}

std::vector<double> measured_power(std::span<const Window> windows, const robot::RobotModel& robot) {
  std::vector<double> power;
  for (const Window& w : windows) power.push_back(w.battery_power_w);
  if (std::ranges::any_of(power, [](double p) { return std::isfinite(p); })) return power;
  const bool volts = voltages_read(windows);
  std::ranges::transform(windows, power.begin(),
                         [&](const Window& w) { return robot.idle_power_w + motors_power(w, robot, volts); });
  return power;
}

}  // namespace joulecast::gap
