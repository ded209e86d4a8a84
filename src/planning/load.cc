#include "planning/load.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/bounds.h"
#include "base/try.h"
#include "dynamics/stribeck_curve.h"

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

using dynamics::Instant;

Result<DriveLoads> DriveLoads::make(const robot::RobotModel& robot, std::optional<double> regeneration) {
  if (regeneration && !fraction.contain(*regeneration))
    return invalid("regeneration", out_of_bounds(*regeneration, fraction));
  TRY_ASSIGN(auto effects, dynamics::active_effects(robot));
  if (regeneration) {
    std::erase_if(effects, [](const auto& e) { return e.effect->info().id == "no_regeneration"; });
    TRY_ASSIGN(auto blocked, dynamics::activate({"no_regeneration", {{"fraction", 1 - *regeneration}}}));
    effects.push_back(blocked);
  }
  DriveLoads loads{dynamics::DriveModel(robot, effects)};
  const auto& p = loads.model_.parameters();
  for (const dynamics::ActiveEffect& effect : effects) {
    loads.needs_position_ |= effect.effect->info().needs == dynamics::Needs::position;
    loads.needs_heading_ |= effect.effect->info().needs == dynamics::Needs::heading;
    if (effect.effect->info().id == "turning_scrub") loads.scrub_rate_rad_s_ = effect.values[1];
    if (effect.effect->info().id == "stribeck_friction") {
      for (std::size_t s : {0u, 1u}) loads.stribeck_nm_[s] = effect.values[0] * p.friction_torque_nm[s];
      loads.stribeck_speed_rad_s_ = effect.values[1];
      loads.stribeck_exponent_ = effect.values[2];
    }
  }
  Electric& e = loads.electric_;
  e.torque_constant_nm_a = p.torque_constant_nm_a;
  e.voltage_constant_v_s_rad = p.voltage_constant_v_s_rad;
  e.back_emf = p.voltage_constant_v_s_rad / p.torque_constant_nm_a;
  e.brush_w_nm = p.brush_drop_v / p.torque_constant_nm_a;
  e.idle_w = p.idle_power_w + p.accessory_power_w;
  e.up = 1 + p.driver_loss;
  e.down = 1 - p.unreturned - p.driver_loss;
  for (std::size_t s : {0u, 1u}) {
    e.volts_per_nm[s] = p.resistance_ohm[s] / p.torque_constant_nm_a;
    e.copper_w_n2_m2[s] = p.resistance_ohm[s] / (p.torque_constant_nm_a * p.torque_constant_nm_a);
  }
  return loads;
}

Instant DriveLoads::instant(const Run& run, const Place& place, double speed, double acceleration) const {
  const auto& p = model_.parameters();
  const double ahead = run.turn == 0 ? 1 : 0, turn = run.turn == 0 ? place.curvature_1_m : run.turn;
  const auto pace = dynamics::wheels_of_body(p, ahead, turn);
  const auto bend = dynamics::wheels_of_body(p, 0, run.turn == 0 ? place.curvature_slope : 0);
  Instant at;
  for (std::size_t s : {0u, 1u}) {
    at.wheel_speed_rad_s[s] = pace[s] * speed;
    at.wheel_acceleration_rad_s2[s] = pace[s] * acceleration + bend[s] * speed * speed;
  }
  at.payload_kg = run.payload_kg;
  at.x_m = place.pose.x_m, at.y_m = place.pose.y_m, at.heading_rad = place.pose.heading_rad;
  return at;
}

WheelLoads DriveLoads::at(const Run& run, const Place& place) const {
  using Load = dynamics::Load;
  struct Torques {
    std::array<double, 2> through{}, inside{}, scrub{};
  };
  const auto torques_at = [&](const Instant& at) {
    const auto b = model_.balance(at);
    Torques t;
    t.scrub = b.loads.torque[static_cast<std::size_t>(Load::scrub)];
    for (std::size_t s : {0u, 1u}) {
      // The part of the friction that the gear transmits with the load.
      const double passed = model_.parameters().gear_friction_share * b.friction_nm[s];
      t.through[s] = b.transmitted_nm[s] + passed;
      t.inside[s] = b.inside_nm[s] + (b.friction_nm[s] - passed);
    }
    return t;
  };
  const Instant rolls = instant(run, place, 1, 0);
  const auto &pace = rolls.wheel_speed_rad_s, &bend = rolls.wheel_acceleration_rad_s2;
  const auto torques = [&](double speed, double acceleration) {
    Instant at = rolls;
    for (std::size_t s : {0u, 1u}) {
      at.wheel_speed_rad_s[s] = pace[s] * speed;
      at.wheel_acceleration_rad_s2[s] = pace[s] * acceleration + bend[s] * speed * speed;
    }
    return torques_at(at);
  };
  // Half of what the direction of rotation changes, extrapolated to standstill from a quadratic.
  const auto dry = [&](std::array<double, 2> Torques::*part, std::size_t s) {
    double sum = 0;
    for (const auto& [speed, weight] : {std::pair{5.0, 1.5}, {10.0, -1.5}, {15.0, 0.5}}) {
      Instant spins = instant(run, place, 0, 0);
      for (const double sign : {1.0, -1.0}) {
        spins.wheel_speed_rad_s = {sign * speed, sign * speed};
        sum += sign * weight * (torques_at(spins).*part)[s];
      }
    }
    return sum;
  };
  // Every load is a quadratic of the speed, except Stribeck friction and scrub, which have given laws: three
  // speeds, well above the creep where dry friction fades, determine the coefficients.
  const Torques slow = torques(0.5, 0), middle = torques(1, 0), fast = torques(1.5, 0),
                pushed = torques(1, 1);
  const auto fit = [](double y0, double y1, double y2, double& c0, double& c1, double& c2) {
    c2 = 2 * (y0 - 2 * y1 + y2);
    c1 = y2 - y0 - 2 * c2;
    c0 = y1 - c1 - c2;
    const double noise = 1e-4 * (std::fabs(y0) + std::fabs(y1) + std::fabs(y2)) + 1e-12;
    if (std::fabs(c2) < noise) c2 = 0, c1 = y2 - y0, c0 = y1 - c1;
    if (std::fabs(c1) < 1e-9) c1 = 0;
  };
  WheelLoads loads;
  for (std::size_t s : {0u, 1u}) {
    WheelLoad& w = loads[s];
    w.pace = pace[s];
    w.inertia = pushed.through[s] - middle.through[s];
    w.gear = model_.parameters().gear_loss * (pace[s] < 0 ? -1 : 1);
    const double direction = pace[s] < 0 ? -1 : 1;
    std::array<double, 3> inside{slow.inside[s], middle.inside[s], fast.inside[s]},
        through{slow.through[s], middle.through[s], fast.through[s]};
    if (scrub_rate_rad_s_ > 0 && middle.scrub[s] != 0) {
      w.scrub_speed = scrub_rate_rad_s_ / (run.turn != 0 ? 1 : std::fabs(place.curvature_1_m));
      w.scrub = middle.scrub[s] / std::tanh(1 / w.scrub_speed);
      through[0] -= slow.scrub[s], through[1] -= middle.scrub[s], through[2] -= fast.scrub[s];
    }
    if (stribeck_nm_[s] != 0 && pace[s] != 0) {
      w.stribeck = stribeck_nm_[s] * direction;
      w.stribeck_speed = stribeck_speed_rad_s_ / std::fabs(pace[s]);
      w.stribeck_exponent = stribeck_exponent_;
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = 0.5 * static_cast<double>(k + 1) / w.stribeck_speed;
        inside[k] -= w.stribeck * dynamics::stribeck_curve(x, w.stribeck_exponent);
      }
    }
    if (const double slow_rad_s = 0.25 * std::fabs(pace[s]); slow_rad_s < creep_rad_s) {
      w.creep = dynamics::friction_width_rad_s / std::max(std::fabs(pace[s]), 1e-9);
      w.t_dry = direction * dry(&Torques::through, s), w.f_dry = direction * dry(&Torques::inside, s);
      for (std::size_t k = 0; k < 3; ++k) {
        const double share = w.direction(0.5 * static_cast<double>(k + 1));
        through[k] -= share * w.t_dry, inside[k] -= share * w.f_dry;
      }
    }
    fit(through[0], through[1], through[2], w.t0, w.t1, w.t2);
    fit(inside[0], inside[1], inside[2], w.f0, w.f1, w.f2);
    // Without gear loss it is all one where a torque acts; inside, it leaves the load linear.
    if (w.gear == 0) w.f1 += std::exchange(w.t1, 0);
  }
  return loads;
}

bool DriveLoads::uniform(const Run& run) const {
  if (needs_position_) return false;
  if (run.turn != 0) return !needs_heading_;
  return run.constant_curvature() && !(needs_heading_ && run.knots[0].curvature_1_m != 0);
}

dynamics::QuadraticPower motor_power(const Electric& electric, std::size_t side, const WheelLoad& load) {
  return dynamics::wheel_power(electric.copper_w_n2_m2[side], electric.back_emf * load.pace, load.inertia,
                               load.f1, load.t0 + load.f0);
}

}  // namespace joulecast::planning
