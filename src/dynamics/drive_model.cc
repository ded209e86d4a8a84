#include "dynamics/drive_model.h"

#include <cmath>

#include "base/try.h"

namespace joulecast::dynamics {
namespace {

template <class S>
S brush_voltage(const Parameters<S>& p, S current_a) {
  if constexpr (std::is_same_v<S, double>) {
    if (p.brush_drop_v == 0) return 0;  // no derivative to keep
  }
  return p.brush_drop_v * smooth_sign(current_a, brush_width_a);
}

}  // namespace

template <class S>
template <class Values>
void BasicDriveModel<S>::apply(std::span<const ActiveEffect> effects, Values&& values_of) {
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const EffectValues<S> values = values_of(k);
    effects[k].effect->adjust(values, parameters_);
    if (effects[k].effect->loads()) loads_.push_back({effects[k].effect, values});
  }
}

template <class S>
BasicDriveModel<S>::BasicDriveModel(const robot::RobotModel& robot,
                                    std::span<const ActiveEffect> effects) requires std::is_same_v<S, double>
    : parameters_(nominal_parameters<S>(robot)) {
  apply(effects, [&](std::size_t k) { return effects[k].values; });
}

template <class S>
BasicDriveModel<S>::BasicDriveModel(const robot::RobotModel& robot, std::span<const ActiveEffect> effects,
                                    std::size_t effect,
                                    std::size_t parameter) requires std::is_same_v<S, Dual>
    : parameters_(nominal_parameters<S>(robot)) {
  apply(effects, [&](std::size_t k) {
    EffectValues<Dual> values{};
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = Dual(effects[k].values[i], k == effect && i == parameter ? 1.0 : 0.0);
    return values;
  });
}

template <class S>
TorqueBalance<S> BasicDriveModel<S>::balance(const Instant& at) const {
  const Parameters<S>& p = parameters_;
  TorqueBalance<S> b;
  b.body = body_of_wheels(p, at.wheel_speed_rad_s, at.wheel_acceleration_rad_s2);

  const S payload = p.payload_factor * at.payload_kg + p.payload_extra_kg;
  const S mass = p.chassis_kg + 2.0 * p.wheel_kg + payload;
  const S yaw_inertia = p.yaw_inertia_kg_m2 + payload * p.payload_yaw_inertia_m2;
  const S coupling = p.chassis_kg * p.com_offset_m;
  // Thesis (2-31) in the body frame: F = m a - m_c d yaw^2, N = I yaw' + m_c d v yaw.
  const S force = mass * p.inertial_factor * b.body.acceleration_m_s2 -
                  coupling * b.body.yaw_rate_rad_s * b.body.yaw_rate_rad_s;
  const S moment =
      yaw_inertia * b.body.yaw_acceleration_rad_s2 + coupling * b.body.speed_m_s * b.body.yaw_rate_rad_s;
  const S arm = moment / (2.0 * p.half_track_m);
  const std::array<S, 2> ground{p.wheel_radius_m[0] * (force * 0.5 + arm),
                                p.wheel_radius_m[1] * (force * 0.5 - arm)};

  const LoadContext<S> context{at,
                               p,
                               b.body,
                               {smooth_sign(at.wheel_speed_rad_s[0], friction_width_rad_s),
                                smooth_sign(at.wheel_speed_rad_s[1], friction_width_rad_s)},
                               mass * robot::standard_gravity_m_s2,
                               payload * robot::standard_gravity_m_s2};
  for (const LoadEffect& load : loads_) load.effect->load(load.values, context, b.loads);

  for (std::size_t s : {0u, 1u}) {
    b.inertial_nm[s] = ground[s] + p.wheel_inertia_kg_m2 * at.wheel_acceleration_rad_s2[s];
    S &transmitted = b.transmitted_nm[s] = b.inertial_nm[s], &inside = b.inside_nm[s];
    for (std::size_t k = 0; k < load_count && !loads_.empty(); ++k)
      (k == static_cast<std::size_t>(Load::internal) ? inside : transmitted) += b.loads.torque[k][s];
    b.friction_nm[s] = p.friction_torque_nm[s] * context.direction[s] +
                       p.viscous_friction_nm_s_rad * at.wheel_speed_rad_s[s];
    b.gear_nm[s] =
        p.gear_loss * abs(transmitted + p.gear_friction_share * b.friction_nm[s]) * context.direction[s];
    b.total_nm[s] = transmitted + inside + b.gear_nm[s] + b.friction_nm[s];
  }
  return b;
}

template <class S>
S BasicDriveModel<S>::resistance(std::size_t side, const Instant& at) const {
  return parameters_.resistance_ohm[side] *
         (S(1) +
          copper_temperature_coefficient_per_k * parameters_.thermal_resistance_k_w * at.copper_heat_w[side]);
}

template <class S>
S BasicDriveModel<S>::winding_voltage(std::size_t side, S current_a, const Instant& at) const {
  const Parameters<S>& p = parameters_;
  return resistance(side, at) * current_a + p.inductance_h * at.current_slope_a_s[side] +
         p.voltage_constant_v_s_rad * at.wheel_speed_rad_s[side];
}

template <class S>
S BasicDriveModel<S>::voltage_for(std::size_t side, S current_a, const Instant& at) const {
  return winding_voltage(side, current_a, at) + brush_voltage(parameters_, current_a);
}

template <class S>
S BasicDriveModel<S>::battery_power_for(const std::array<S, 2>& motor_power_w) const {
  const Parameters<S>& p = parameters_;
  S power = p.idle_power_w + p.accessory_power_w;
  for (const S& motor : motor_power_w) {
    power += p.driver_loss * abs(motor);
    power += motor > S(0) ? motor : motor * (S(1) - p.unreturned);
  }
  return power;
}

template <class S>
PowerFlow<S> BasicDriveModel<S>::flow(const Instant& at) const {
  const Parameters<S>& p = parameters_;
  const TorqueBalance<S> b = balance(at);
  const S grip = S(1) - p.slip;
  PowerFlow<S> f;
  using signals::Term;
  auto& ledger = f.ledger;
  ledger[Term::accessories] = p.idle_power_w + p.accessory_power_w;
  for (std::size_t s : {0u, 1u}) {
    const double speed = at.wheel_speed_rad_s[s];
    f.torque_nm[s] = b.total_nm[s];
    f.current_a[s] = current_for(b.total_nm[s]);
    const S winding_v = winding_voltage(s, f.current_a[s], at), brush = p.brush_drop_v * abs(f.current_a[s]);
    f.voltage_v[s] = winding_v + brush_voltage(p, f.current_a[s]);
    f.motor_power_w[s] = winding_v * f.current_a[s] + brush;

    ledger[Term::copper] += resistance(s, at) * f.current_a[s] * f.current_a[s];
    ledger[Term::brush] += brush;
    // Field energy of the winding, and the difference by unequal SI values of K_t and K_w, stay in the motor.
    ledger[Term::kinetic] += p.inductance_h * at.current_slope_a_s[s] * f.current_a[s];
    ledger[Term::friction_internal] +=
        (p.voltage_constant_v_s_rad - p.torque_constant_nm_a) * speed * f.current_a[s];
    const auto power = [&](Load load) { return b.loads.torque[static_cast<std::size_t>(load)][s] * speed; };
    ledger[Term::friction_internal] += (b.friction_nm[s] + b.gear_nm[s]) * speed + power(Load::internal);
    ledger[Term::friction_rolling] += power(Load::rolling);
    ledger[Term::friction_zone] += power(Load::zone);
    // Slip: of the power that reaches the ground through the wheel, the body gets (1 - slip).
    const S wheel_inertia = p.wheel_inertia_kg_m2 * at.wheel_acceleration_rad_s2[s];
    const S body_inertia = (b.inertial_nm[s] - wheel_inertia) * speed;
    ledger[Term::kinetic] += wheel_inertia * speed + body_inertia * grip;
    ledger[Term::friction_scrub] += power(Load::scrub) * grip;
    ledger[Term::drag] += power(Load::drag) * grip;
    ledger[Term::potential] += power(Load::potential) * grip;
    ledger[Term::friction_slip] +=
        (body_inertia + power(Load::scrub) + power(Load::drag) + power(Load::potential)) * p.slip;

    ledger[Term::driver] += p.driver_loss * abs(f.motor_power_w[s]);
    if (f.motor_power_w[s] < S(0)) {
      ledger[Term::braking] -= f.motor_power_w[s];
      ledger[Term::recovered] -= f.motor_power_w[s] * (S(1) - p.unreturned);
    }
  }
  f.battery_power_w = battery_power_for(f.motor_power_w);
  return f;
}

template <class S>
S BasicDriveModel<S>::metered_battery_power(S power_w, double battery_voltage_v) const {
  const Parameters<S>& p = parameters_;
  const double volts = std::isfinite(battery_voltage_v) ? battery_voltage_v : p.battery_voltage_v;
  return (S(1) + p.battery_voltage.gain) *
         (power_w * (S(1) + p.battery_current.gain) + p.battery_current.bias * volts);
}

template class BasicDriveModel<double>;
template class BasicDriveModel<Dual>;

Result<std::vector<ActiveEffect>> active_effects(const robot::RobotModel& robot) {
  std::vector<ActiveEffect> effects;
  effects.reserve(robot.effects.size());
  for (const robot::AdoptedEffect& adopted : robot.effects) {
    TRY_ASSIGN(ActiveEffect active, activate(adopted));
    effects.push_back(active);
  }
  return effects;
}

Result<DriveModel> drive_model(const robot::RobotModel& robot) {
  TRY_ASSIGN(std::vector<ActiveEffect> effects, active_effects(robot));
  return DriveModel(robot, effects);
}

}  // namespace joulecast::dynamics
