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

std::vector<double> measured_power(std::span<const Window> windows, const robot::RobotModel& robot,
                                   bool of_motors) {
  std::vector<double> power(windows.size());
  const bool volts = voltages_read(windows);
  std::ranges::transform(windows, power.begin(), [&](const Window& w) {
    return of_motors ? robot.idle_power_w + motors_power(w, robot, volts) : w.battery_power_w;
  });
  return power;
}

std::vector<double> modelled_power(const robot::RobotModel& robot,
                                   std::span<const dynamics::ActiveEffect> adopted,
                                   std::span<const Cause> causes, std::span<const Window> windows) {
  std::vector<dynamics::ActiveEffect> effects(adopted.begin(), adopted.end());
  for (const Cause& cause : causes) {
    if (!cause.by) effects.push_back(cause.effect);
  }
  const std::size_t steady = effects.size();
  std::vector<double> power(windows.size());
  std::optional<dynamics::DriveModel> model;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (steady - adopted.size() < causes.size()) {
      effects.resize(steady);
      for (const Cause& cause : causes) {
        if (!cause.by) continue;
        effects.push_back(cause.effect);
        effects.back().values[cause.parameter] *= cause.by->of(windows[k]);
      }
      model.reset();
    }
    if (!model) model.emplace(robot, effects);
    power[k] = metered_powers(*model, windows[k]).battery_w;
  }
  return power;
}

GapSize gap_size(std::span<const double> measured_w, std::span<const double> modelled_w) {
  double difference = 0, absolute = 0, total = 0, size = 0;
  for (std::size_t k = 0; k < measured_w.size(); ++k) {
    const double e = measured_w[k] - modelled_w[k];
    if (!std::isfinite(e)) continue;
    difference += e;
    absolute += std::fabs(e);
    total += measured_w[k];
    size += std::fabs(measured_w[k]);
  }
  GapSize gap;
  gap.energy_relative = total != 0 ? difference / total : 0;
  gap.absolute_relative = size > 0 ? absolute / size : 0;
  return gap;
}

}  // namespace joulecast::gap
