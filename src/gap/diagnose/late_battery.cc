#include "gap/diagnose/late_battery.h"

#include <cmath>
#include <vector>

namespace joulecast::gap {

void move_battery_back(telemetry::Recording& mission, double delay_s) {
  struct Read {
    double time_s, voltage_v, current_a;
  };
  std::vector<Read> read;
  for (const signals::Sample& s : mission.samples)
    read.push_back({1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us),
                    s.battery_voltage_v, s.battery_current_a});
  std::size_t next = 1;
  for (std::size_t k = 0; k < read.size(); ++k) {
    signals::Sample& s = mission.samples[k];
    const double time_s = read[k].time_s + delay_s;
    while (next + 1 < read.size() && read[next].time_s < time_s) ++next;
    s.battery_voltage_v = s.battery_current_a = signals::unmeasured;
    if (next >= read.size()) continue;
    const Read &a = read[next - 1], &b = read[next];
    const double part = (time_s - a.time_s) / (b.time_s - a.time_s);
    constexpr double rounding = 1e-6;
    if (!(part >= -rounding && part <= 1 + rounding)) continue;
    s.battery_voltage_v = std::lerp(a.voltage_v, b.voltage_v, part);
    s.battery_current_a = std::lerp(a.current_a, b.current_a, part);
  }
}

}  // namespace joulecast::gap
