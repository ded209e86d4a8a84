#include "tests/dynamics/forward/forward.h"

#include <algorithm>
#include <cmath>

namespace joulecast::dynamics {
namespace {

constexpr int most_newton_steps = 40;

Instant instant_of(const DriveState& state, double payload_kg) {
  Instant at;
  at.wheel_speed_rad_s = state.wheel_speed_rad_s;
  at.payload_kg = payload_kg;
  at.x_m = state.x_m;
  at.y_m = state.y_m;
  at.heading_rad = state.heading_rad;
  at.climb_rad = state.climb_rad;
  at.copper_heat_w = state.copper_heat_w;
  return at;
}

}  // namespace

std::array<double, 2> wheel_accelerations(const DriveModel& model, const DriveState& state, double payload_kg,
                                          const std::array<double, 2>& torque_nm) {
  Instant at = instant_of(state, payload_kg);
  std::array<double, 2> acceleration{};
  constexpr int max_steps = 16;  // the kink of gear loss is crossed at most once a wheel
  for (int step = 0; step < max_steps; ++step) {
    const auto needed = [&](double right, double left) {
      at.wheel_acceleration_rad_s2 = {right, left};
      return model.balance(at).total_nm;
    };
    // The balance is piecewise affine: differences are exact unless they straddle the kink, so they are
    // short.
    constexpr double reach = 1e-3;
    const auto base = needed(acceleration[0], acceleration[1]);
    const auto right = needed(acceleration[0] + reach, acceleration[1]);
    const auto left = needed(acceleration[0], acceleration[1] + reach);
    const double a = (right[0] - base[0]) / reach, b = (left[0] - base[0]) / reach;
    const double c = (right[1] - base[1]) / reach, d = (left[1] - base[1]) / reach;
    const double e = torque_nm[0] - base[0], f = torque_nm[1] - base[1];
    const double determinant = a * d - b * c;
    const double dr = (e * d - b * f) / determinant, dl = (a * f - e * c) / determinant;
    acceleration[0] += dr;
    acceleration[1] += dl;
    if (std::fabs(dr) + std::fabs(dl) <=
        1e-12 * (1 + std::fabs(acceleration[0]) + std::fabs(acceleration[1])))
      break;
  }
  return acceleration;
}

std::array<double, 2> algebraic_current(const DriveModel& model, const DriveState& state,
                                        const std::array<double, 2>& voltage_v) {
  const Instant at = instant_of(state, 0);
  std::array<double, 2> current{};
  for (std::size_t s : {0u, 1u}) {
    const double driving =
        voltage_v[s] - model.parameters().voltage_constant_v_s_rad * state.wheel_speed_rad_s[s];
    const double ohm = model.resistance(s, at), drop = model.parameters().brush_drop_v;
    // R i + drop sgn(i) = driving with the smooth sign of voltage_for: concave for i > 0, so that Newton's
    // method climbs to the root from the current that a full drop would leave.
    Dual i{std::max(0.0, (std::fabs(driving) - drop) / ohm), 1};
    for (int step = 0; drop > 0 && step < most_newton_steps; ++step) {
      const Dual excess = ohm * i + drop * smooth_sign(i, brush_width_a) - std::fabs(driving);
      const double change = -excess.value / excess.slope;
      i.value += change;
      if (std::fabs(change) <= 1e-14 * (1 + i.value)) break;
    }
    current[s] = std::copysign(i.value, driving);
  }
  return current;
}

DriveState derivative(const DriveModel& model, const DriveState& state, double payload_kg,
                      double inductance_h, const std::array<double, 2>& voltage_v) {
  const Instant at = instant_of(state, payload_kg);
  const Parameters<double>& p = model.parameters();
  const double inductance = inductance_h + p.inductance_h;
  const std::array<double, 2> current =
      inductance > 0 ? state.current_a : algebraic_current(model, state, voltage_v);
  const auto acceleration = wheel_accelerations(
      model, state, payload_kg, {p.torque_constant_nm_a * current[0], p.torque_constant_nm_a * current[1]});
  const Body<double> body = body_of_wheels(p, state.wheel_speed_rad_s, acceleration);
  DriveState rate;
  rate.climb_rad = 0;
  rate.x_m = body.speed_m_s * std::cos(state.heading_rad);
  rate.y_m = body.speed_m_s * std::sin(state.heading_rad);
  rate.heading_rad = body.yaw_rate_rad_s;
  rate.wheel_angle_rad = state.wheel_speed_rad_s;
  rate.wheel_speed_rad_s = acceleration;
  for (std::size_t s : {0u, 1u}) {
    if (inductance > 0)
      rate.current_a[s] = (voltage_v[s] - model.voltage_for(s, current[s], at)) / inductance;
    const double heat = model.resistance(s, at) * current[s] * current[s];
    rate.copper_heat_w[s] = (heat - state.copper_heat_w[s]) / p.thermal_time_constant_s;
  }
  return rate;
}

}  // namespace joulecast::dynamics
