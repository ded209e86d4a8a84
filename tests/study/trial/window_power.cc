#include "tests/study/trial/window_power.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace joulecast::trial {
namespace {

// Copper heat on any time constant, from the grid of them that a window carries.
double copper_heat_w(const windows::Window& w, std::size_t side, double time_constant_s) {
  const auto& grid = windows::heat_time_constants_s;
  const double position = std::log2(time_constant_s / grid.front());
  const auto last = static_cast<double>(grid.size() - 1);
  const double at = std::clamp(position, 0.0, last);
  const auto below = std::min(static_cast<std::size_t>(at), grid.size() - 2);
  return std::lerp(w.copper_heat_w[below][side], w.copper_heat_w[below + 1][side],
                   at - static_cast<double>(below));
}

}  // namespace

template <class S>
S window_power_w(const dynamics::BasicDriveModel<S>& model, const windows::Window& w) {
  const auto& parameters = model.parameters();
  dynamics::Instant at;
  at.payload_kg = w.payload_kg;
  at.x_m = w.x_m;
  at.y_m = w.y_m;
  at.heading_rad = w.heading_rad;
  at.climb_rad = w.climb_rad;
  for (std::size_t s : {0u, 1u}) {
    at.copper_heat_w[s] = copper_heat_w(w, s, parameters.thermal_time_constant_s);
    at.current_slope_a_s[s] = std::isfinite(w.current_slope_a_s[s]) ? w.current_slope_a_s[s] : 0;
    if (!w.resting[s]) at.wheel_acceleration_rad_s2[s] = w.acceleration_rad_s2[s];
  }
  S power = 0;
  if (w.resting[0] && w.resting[1]) {
    power = model.battery_power_for({S(0), S(0)});
  } else {
    // Begin, middle and end apart: friction is no straight line of speed.
    const bool whole = std::ranges::all_of(w.part_weight, [](double weight) { return weight > 0; });
    for (std::size_t part = 0; part < (whole ? w.part_weight.size() : 1); ++part) {
      for (std::size_t s : {0u, 1u}) {
        const double speed = whole ? w.part_speed_rad_s[part][s] : w.speed_rad_s[s];
        at.wheel_speed_rad_s[s] = w.resting[s] ? 0 : speed;
      }
      power += (whole ? w.part_weight[part] : 1) * model.flow(at).battery_power_w;
    }
  }
  const double slope_w_s = std::isfinite(w.battery_power_slope_w_s) ? w.battery_power_slope_w_s : 0;
  return model.metered_battery_power(power, w.battery_voltage_v) -
         (parameters.sensor_delay_s - w.electrical_shift_s) * slope_w_s;
}

template double window_power_w(const dynamics::BasicDriveModel<double>&, const windows::Window&);
template dynamics::Dual window_power_w(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                       const windows::Window&);

std::vector<double> window_powers_w(const robot::RobotModel& robot,
                                    std::span<const dynamics::ActiveEffect> effects,
                                    std::span<const windows::Window> windows) {
  // Throws where the catalogue rejects the file of a robot that the trial drew: no case may go on from there.
  auto all = dynamics::active_effects(robot).value();
  all.insert(all.end(), effects.begin(), effects.end());
  const dynamics::DriveModel model(robot, all);
  std::vector<double> power(windows.size());
  std::ranges::transform(windows, power.begin(), [&](const auto& w) { return window_power_w(model, w); });
  return power;
}

}  // namespace joulecast::trial
