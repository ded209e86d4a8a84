#include "planning/peaks.h"

#include <algorithm>
#include <cmath>

namespace joulecast::planning {

void Peaks::reach(const Peaks& other) {
  for (double Peaks::*peak :
       {&Peaks::peak_speed_m_s, &Peaks::peak_acceleration_m_s2, &Peaks::peak_yaw_rate_rad_s,
        &Peaks::peak_wheel_speed_rad_s, &Peaks::peak_current_a, &Peaks::peak_voltage_v}) {
    this->*peak = std::max(this->*peak, other.*peak);
  }
}

void Peaks::reach(const std::array<double, 2>& wheel_speed_rad_s, const dynamics::PowerFlow<double>& flow) {
  for (const std::size_t s : {0u, 1u}) {
    peak_wheel_speed_rad_s = std::max(peak_wheel_speed_rad_s, std::fabs(wheel_speed_rad_s[s]));
    peak_current_a = std::max(peak_current_a, std::fabs(flow.current_a[s]));
    peak_voltage_v = std::max(peak_voltage_v, std::fabs(flow.voltage_v[s]));
  }
}

std::vector<BrokenLimit> Peaks::beyond(const Limits& limits) const {
  constexpr double rounding = 1 + 1e-6;
  std::vector<BrokenLimit> broken;
  for (const BrokenLimit& bound :
       {BrokenLimit{"speed", peak_speed_m_s, limits.speed_m_s},
        BrokenLimit{"acceleration", peak_acceleration_m_s2, limits.acceleration_m_s2},
        BrokenLimit{"yaw_rate", peak_yaw_rate_rad_s, limits.yaw_rate_rad_s},
        BrokenLimit{"wheel_speed", peak_wheel_speed_rad_s, limits.wheel_speed_rad_s},
        BrokenLimit{"current", peak_current_a, limits.current_a},
        BrokenLimit{"voltage", peak_voltage_v, limits.voltage_v}}) {
    if (bound.reached > bound.allowed * rounding) broken.push_back(bound);
  }
  return broken;
}

}  // namespace joulecast::planning
