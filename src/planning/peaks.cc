#include "planning/peaks.h"

#include <algorithm>
#include <cmath>

namespace joulecast::planning {
namespace {

// Tolerances for rows rounded to 1e-6, and for the motors' limits: motions may exceed them between rows, and
// by the share of dry friction that is missing just above creeping.
constexpr double rounding = 1e-6, of_slopes = 1.5e-3;

}  // namespace

bool creeps(const std::array<double, 2>& wheel_speed_rad_s) {
  return std::max(std::fabs(wheel_speed_rad_s[0]), std::fabs(wheel_speed_rad_s[1])) < creep_rad_s;
}

void Peaks::reach(const Peaks& other) {
  for (double Peaks::*peak :
       {&Peaks::peak_speed_m_s, &Peaks::peak_acceleration_m_s2, &Peaks::peak_yaw_rate_rad_s,
        &Peaks::peak_wheel_speed_rad_s, &Peaks::peak_current_a, &Peaks::peak_voltage_v}) {
    this->*peak = std::max(this->*peak, other.*peak);
  }
}

void Peaks::reach(const std::array<double, 2>& wheel_speed_rad_s, const dynamics::PowerFlow<double>& flow) {
  const bool creeping = creeps(wheel_speed_rad_s);
  for (const std::size_t s : {0u, 1u}) {
    peak_wheel_speed_rad_s = std::max(peak_wheel_speed_rad_s, std::fabs(wheel_speed_rad_s[s]));
    if (creeping) continue;
    peak_current_a = std::max(peak_current_a, std::fabs(flow.current_a[s]));
    peak_voltage_v = std::max(peak_voltage_v, std::fabs(flow.voltage_v[s]));
  }
}

std::vector<BrokenLimit> Peaks::beyond(const Limits& limits) const {
  struct Limit {
    BrokenLimit bound;
    double tolerance;
  };
  std::vector<BrokenLimit> broken;
  for (const auto& [bound, tolerance] :
       {Limit{{"speed", peak_speed_m_s, limits.speed_m_s}, rounding},
        {{"acceleration", peak_acceleration_m_s2, limits.acceleration_m_s2}, of_slopes},
        {{"yaw_rate", peak_yaw_rate_rad_s, limits.yaw_rate_rad_s}, rounding},
        {{"wheel_speed", peak_wheel_speed_rad_s, limits.wheel_speed_rad_s}, rounding},
        {{"current", peak_current_a, limits.current_a}, of_slopes},
        {{"voltage", peak_voltage_v, limits.voltage_v}, of_slopes}}) {
    if (bound.reached > bound.allowed * (1 + tolerance)) broken.push_back(bound);
  }
  return broken;
}

}  // namespace joulecast::planning
