#include "gap/diagnose/late_battery.h"

#include <array>
#include <cmath>
#include <vector>

namespace joulecast::gap {
namespace {

using Readings6 = std::array<double, 6>;

Readings6 electrical(const signals::Sample& s) {
  return {s.battery_voltage_v,  s.battery_current_a,  s.motor_voltage_v[0],
          s.motor_voltage_v[1], s.motor_current_a[0], s.motor_current_a[1]};
}

// `count`: number of readings that move, the first in the order of electrical().
void move_back(telemetry::Recording& mission, double delay_s, std::size_t count) {
  std::vector<double> time_s;
  std::vector<Readings6> read;
  for (const signals::Sample& s : mission.samples) {
    time_s.push_back(1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us));
    read.push_back(electrical(s));
  }
  std::size_t next = 1;
  for (std::size_t k = 0; k < read.size(); ++k) {
    signals::Sample& s = mission.samples[k];
    const double at_s = time_s[k] + delay_s;
    while (next + 1 < read.size() && time_s[next] < at_s) ++next;
    const std::array<double*, 6> moved{&s.battery_voltage_v,  &s.battery_current_a,  &s.motor_voltage_v[0],
                                       &s.motor_voltage_v[1], &s.motor_current_a[0], &s.motor_current_a[1]};
    for (std::size_t c = 0; c < count; ++c) *moved[c] = signals::unmeasured;
    if (next >= read.size()) continue;
    const double part = (at_s - time_s[next - 1]) / (time_s[next] - time_s[next - 1]);
    constexpr double rounding = 1e-6;
    if (!(part >= -rounding && part <= 1 + rounding)) continue;
    for (std::size_t c = 0; c < count; ++c) *moved[c] = std::lerp(read[next - 1][c], read[next][c], part);
  }
}

}  // namespace

void move_battery_back(telemetry::Recording& mission, double delay_s) {
  move_back(mission, delay_s, 2);
}

void move_electrical_back(telemetry::Recording& mission, double delay_s) {
  move_back(mission, delay_s, 6);
}

}  // namespace joulecast::gap
