#include "gap/equations/channels.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace joulecast::gap {
namespace {

using dynamics::Dual;

// Where a current changes sign within a window, the brushes' voltage drop is uncertain.
constexpr double clear_sign = 0.9;

// Copper heat for any time constant, interpolated between those of the windows.
std::array<double, 2> heat_at(const Window& w, double time_constant_s) {
  const auto& grid = windows::heat_time_constants_s;
  const double tau = std::clamp(time_constant_s, grid.front(), grid.back());
  std::size_t k = 0;
  while (k + 2 < grid.size() && grid[k + 1] < tau) ++k;
  const double part = std::log(tau / grid[k]) / std::log(grid[k + 1] / grid[k]);
  std::array<double, 2> heat{};
  for (std::size_t s : {0u, 1u})
    heat[s] = (1 - part) * w.copper_heat_w[k][s] + part * w.copper_heat_w[k + 1][s];
  return heat;
}

template <class S>
dynamics::Instant instant_of(const dynamics::BasicDriveModel<S>& model, const Window& w) {
  dynamics::Instant at = windows::instant_of(w);
  at.copper_heat_w = heat_at(w, model.parameters().thermal_time_constant_s);
  for (std::size_t s : {0u, 1u}) {
    // At a wheel at rest, friction balances the load; its motor needs no current.
    if (w.resting[s]) at.wheel_speed_rad_s[s] = at.wheel_acceleration_rad_s2[s] = 0;
    at.current_slope_a_s[s] = std::isfinite(w.current_slope_a_s[s]) ? w.current_slope_a_s[s] : 0.0;
  }
  return at;
}

// Motions that represent a window. Friction is nonlinear in speed: where the speed changes within the window,
// its begin, middle and end are evaluated separately.
struct Nodes {
  std::array<dynamics::Instant, 3> at;
  std::array<double, 3> weight{1, 0, 0};
  std::size_t count = 1;

  Nodes(const Window& w, const dynamics::Instant& middle) {
    constexpr double least_change_rad_s = 0.05;  // from begin to end
    const auto changes = [&](std::size_t s) {
      return !w.resting[s] &&
             std::fabs(w.part_speed_rad_s[2][s] - w.part_speed_rad_s[0][s]) > least_change_rad_s;
    };
    at[0] = middle;
    if (!changes(0) && !changes(1)) return;
    at.fill(middle);
    weight = w.part_weight;
    count = at.size();
    for (std::size_t part = 0; part < count; ++part) {
      for (std::size_t s : {0u, 1u}) {
        if (w.resting[s]) continue;
        at[part].wheel_speed_rad_s[s] = w.part_speed_rad_s[part][s];
        at[part].wheel_acceleration_rad_s2[s] = w.part_acceleration_rad_s2[part][s];
      }
    }
  }
};

}  // namespace

std::string_view name_of(Channel channel) {
  switch (channel) {
    case Channel::voltage_right:
    case Channel::voltage_left:
      return "motor_voltage";
    case Channel::torque_right:
    case Channel::torque_left:
      return "wheel_torque";
    case Channel::drive_right:
    case Channel::drive_left:
      return "motor_voltage_from_motion";
    case Channel::bus:
      return "battery_power_from_motors";
    case Channel::power:
      return "battery_power_from_motion";
    case Channel::battery_voltage:
      return "battery_voltage";
    case Channel::gyro:
      return "yaw_rate";
    case Channel::travel:
      return "map_travel";
    case Channel::turn:
      return "map_turn";
  }
  return "";
}

template <class S>
MeteredPower<S> metered_powers(const dynamics::BasicDriveModel<S>& model, const Window& w) {
  const auto& p = model.parameters();
  const Nodes nodes(w, instant_of(model, w));
  S battery = 0;
  std::array<S, 2> motor{};
  for (std::size_t n = 0; n < nodes.count; ++n) {
    // At a robot at rest, friction balances the load.
    if (nodes.at[n].wheel_speed_rad_s == std::array{0.0, 0.0}) {
      battery += model.battery_power_for({S(0), S(0)}) * nodes.weight[n];
      continue;
    }
    const auto flow = model.flow(nodes.at[n]);
    battery += flow.battery_power_w * nodes.weight[n];
    for (std::size_t s : {0u, 1u})
      motor[s] += ((S(1) + p.motor_voltage.gain) * flow.voltage_v[s] + p.motor_voltage.bias) *
                  ((S(1) + p.motor_current.gain) * flow.current_a[s] + p.motor_current.bias) *
                  nodes.weight[n];
  }
  battery = model.metered_battery_power(battery, w.mission_voltage_v) -
            (p.sensor_delay_s - w.electrical_shift_s) *
                (std::isfinite(w.battery_power_slope_w_s) ? w.battery_power_slope_w_s : 0.0);
  return {battery, motor[0] + motor[1], motor};
}

template <class S>
ChannelValues<S> residuals(const dynamics::BasicDriveModel<S>& model, const Window& w, bool no_currents) {
  const auto& p = model.parameters();
  const S delay = p.sensor_delay_s - w.electrical_shift_s;  // that the windows still contain
  ChannelValues<S> r;
  r.fill(S(missing));
  const dynamics::Instant at = instant_of(model, w);
  const Nodes nodes(w, at);
  std::array<S, 2> torque_nm{};
  S yaw_rate_rad_s = 0;
  for (std::size_t n = 0; n < nodes.count; ++n) {
    const auto balance = model.balance(nodes.at[n]);
    for (std::size_t s : {0u, 1u}) torque_nm[s] += balance.total_nm[s] * nodes.weight[n];
    yaw_rate_rad_s += balance.body.yaw_rate_rad_s * nodes.weight[n];
  }
  std::array<S, 2> motor_power{};
  S motor_abs = 0, braking = 0;
  for (std::size_t s : {0u, 1u}) {
    // Compares readings with the sensors' expected readings, so that no regressor carries their noise except
    // the measured current in the voltage's.
    const S reading = w.current_a[s] + delay * w.current_slope_a_s[s];
    const S current = (reading - p.motor_current.bias) / (S(1) + p.motor_current.gain);
    // The brushes' share by the mean sign within the window, not by the sign of the mean.
    const S voltage =
        model.voltage_for(s, current, at) +
        p.brush_drop_v * (S(w.current_sign[s]) - dynamics::smooth_sign(current, dynamics::brush_width_a));
    if (!w.motors_apart && (w.resting[s] || std::fabs(w.current_sign[s]) > clear_sign))
      r[index_of(Channel::voltage_right) + s] = w.voltage_v[s] + delay * w.voltage_slope_v_s[s] -
                                                (S(1) + p.motor_voltage.gain) * voltage -
                                                p.motor_voltage.bias;
    if (w.moving[s] && !w.motors_apart)
      r[index_of(Channel::torque_right) + s] =
          reading - (S(1) + p.motor_current.gain) * model.current_for(torque_nm[s]) - p.motor_current.bias;
    if (no_currents && !w.motors_apart && (w.moving[s] || w.resting[s])) {
      const S asked = w.resting[s] ? S(0) : model.voltage_for(s, model.current_for(torque_nm[s]), at);
      r[index_of(Channel::drive_right) + s] = w.voltage_v[s] + delay * w.voltage_slope_v_s[s] -
                                              (S(1) + p.motor_voltage.gain) * asked - p.motor_voltage.bias;
    }
    const S gain = (S(1) + p.motor_current.gain) * (S(1) + p.motor_voltage.gain);
    motor_power[s] = (S(w.motor_power_w[s]) - p.motor_current.bias * w.voltage_v[s]) / gain;
    motor_abs += S(w.motor_power_abs_w[s]) / gain;
    braking += S(w.braking_w[s]) / gain;
  }
  const S bus = p.idle_power_w + p.accessory_power_w + motor_power[0] + motor_power[1] +
                p.driver_loss * motor_abs + p.unreturned * braking;
  r[index_of(Channel::bus)] = S(w.battery_power_w) - model.metered_battery_power(bus, w.mission_voltage_v);
  // The difference of the open-circuit voltage from the nominal one is a nuisance of its own.
  r[index_of(Channel::battery_voltage)] =
      S(w.battery_voltage_v) - (S(1) + p.battery_voltage.gain) * p.battery_voltage_v +
      p.battery_resistance_ohm * (S(w.battery_current_a) - p.battery_current.bias) /
          (S(1) + p.battery_current.gain);
  r[index_of(Channel::gyro)] = S(w.yaw_rate_rad_s) - yaw_rate_rad_s;
  const S grip = S(1) - p.slip;
  const S right = p.wheel_radius_m[0] * grip * w.span_angle_rad[0],
          left = p.wheel_radius_m[1] * grip * w.span_angle_rad[1];
  r[index_of(Channel::travel)] = S(w.forward_m) - w.chord * 0.5 * (right + left);
  r[index_of(Channel::turn)] = S(w.turn_rad) - (right - left) / (2.0 * p.half_track_m);
  return r;
}

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

template MeteredPower<double> metered_powers(const dynamics::BasicDriveModel<double>&, const Window&);
template MeteredPower<Dual> metered_powers(const dynamics::BasicDriveModel<Dual>&, const Window&);
template ChannelValues<double> residuals(const dynamics::BasicDriveModel<double>&, const Window&, bool);
template ChannelValues<Dual> residuals(const dynamics::BasicDriveModel<Dual>&, const Window&, bool);

}  // namespace joulecast::gap
