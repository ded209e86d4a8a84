#include <algorithm>
#include <cmath>

#include "statistics/robust.h"
#include "statistics/updates.h"
#include "windows/track.h"
#include "windows/windows.h"

namespace joulecast::windows {
namespace {

constexpr double read_often = 0.2;  // of the rows

// Rows over all missions, and how many have a reading.
struct Coverage {
  std::size_t rows = 0, currents = 0, voltages = 0, battery = 0;

  void add(const signals::Sample& s) {
    ++rows;
    currents += std::isfinite(s.motor_current_a[0] + s.motor_current_a[1]) ? 1 : 0;
    voltages += std::isfinite(s.motor_voltage_v[0] + s.motor_voltage_v[1]) ? 1 : 0;
    battery += std::isfinite(s.battery_voltage_v * s.battery_current_a) ? 1 : 0;
  }
  bool often(std::size_t count) const {
    return static_cast<double>(count) > read_often * static_cast<double>(rows);
  }
};

}  // namespace

Readings find_readings(std::span<const telemetry::Recording> missions) {
  std::vector<double> rows, battery_periods, motor_periods;
  Coverage coverage;
  for (const telemetry::Recording& mission : missions) {
    rows.push_back(median_period_s(mission));
    std::vector<double> time_s, battery_a, motor_a;
    for (const signals::Sample& s : mission.samples) {
      time_s.push_back(1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us));
      battery_a.push_back(s.battery_current_a);
      motor_a.push_back(s.motor_current_a[0]);
      coverage.add(s);
    }
    const auto battery = statistics::find_updates(time_s, battery_a);
    const auto motors = statistics::find_updates(time_s, motor_a);
    if (battery.held) battery_periods.push_back(battery.period_s);
    if (motors.held) motor_periods.push_back(motors.period_s);
  }
  Readings readings;
  readings.row_s = statistics::median(std::move(rows));
  const auto held = [&](std::vector<double> periods) {
    if (2 * periods.size() <= missions.size()) return 0.0;
    const double period = statistics::median(std::move(periods));
    return period > 0.5 * WindowSettings{}.length_s ? period : 0.0;
  };
  const double battery_s = held(std::move(battery_periods)), motors_s = held(std::move(motor_periods));
  readings.battery_held = battery_s > 0;
  readings.motors_held = motors_s > 0;
  readings.period_s = std::max({battery_s, motors_s, readings.row_s});
  readings.motor_currents = coverage.often(coverage.currents);
  readings.motor_voltages = coverage.often(coverage.voltages);
  readings.battery_power = coverage.battery > 0;
  return readings;
}

}  // namespace joulecast::windows
