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

}  // namespace joulecast::gap
