#pragma once

#include "dynamics/effect.h"
#include "dynamics/stribeck_curve.h"

namespace joulecast::dynamics {

struct CoulombFriction {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.9, 20, "extra internal dry friction over the nominal T_m of each side"},
      {"extra_nm", "N m", 0, -1000, 10000, "extra internal dry friction of each side, beside that", true}};
  static constexpr EffectInfo info{
      "coulomb_friction",      ActsOn::wheel_torque, "T = ((1 + a) T_m + b) sgn(w)",
      "any speed above creep", "thesis (2-32), T_m", parameters};

  static void adjust(const auto& a, auto& p) {
    for (auto& torque : p.friction_torque_nm) torque = torque * (1.0 + a[0]) + a[1];
  }
};

struct ViscousFriction {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -1, 200, "extra viscous friction over the nominal nu"},
      {"extra_nm_s_rad", "N m s/rad", 0, -100, 1000, "extra viscous friction of each side, beside that",
       true}};
  static constexpr EffectInfo info{"viscous_friction",       ActsOn::wheel_torque,
                                   "T = ((1 + a) nu + b) w", "lubricated gears and bearings",
                                   "thesis (2-32), nu",      parameters};

  static void adjust(const auto& a, auto& p) {
    p.viscous_friction_nm_s_rad = p.viscous_friction_nm_s_rad * (1.0 + a[0]) + a[1];
  }
};

struct StribeckFriction {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, 0, 20,
       "breakaway friction above T_m, over T_m with coulomb_friction and friction_asymmetry"},
      {"speed_rad_s", "rad/s", 2, 0.2, 100, "Stribeck speed of the wheel"},
      {"exponent", "1", 2, 1, 2, "of the speed in the exponential"}};
  static constexpr EffectInfo info{"stribeck_friction",
                                   ActsOn::wheel_torque,
                                   "T = a T_m exp(-|w/w_s|^d) sgn(w)",
                                   "low speed, boundary lubrication",
                                   "Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2",
                                   parameters};

  static void load(const auto& a, const auto& c, auto& loads) {
    for (std::size_t s : {0u, 1u}) {
      const auto x = c.at.wheel_speed_rad_s[s] / a[1];
      loads.wheel(Load::internal, s,
                  a[0] * c.parameters.friction_torque_nm[s] * stribeck_curve(x, a[2]) * c.direction[s]);
    }
  }
};

struct FrictionAsymmetry {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.9, 20, "extra dry friction of that side over its T_m, coulomb_friction included"},
      {"side", "1", 0, 0, 1, "0 right, 1 left"}};
  static constexpr EffectInfo info{"friction_asymmetry",
                                   ActsOn::wheel_torque,
                                   "T = (1 + a) T_m sgn(w) on one side only",
                                   "one motor or gear worn",
                                   "thesis section 3.1: T_m differs between the sides",
                                   parameters};

  static void adjust(const auto& a, auto& p) {
    p.friction_torque_nm[value_of(a[1]) < 0.5 ? 0 : 1] *= 1.0 + a[0];
  }
};

struct LoadRollingResistance {
  static constexpr EffectParameter parameters[] = {
      {"coefficient", "1", 0, 0, 0.3, "rolling resistance of the payload weight"}};
  static constexpr EffectInfo info{
      "load_rolling_resistance",
      ActsOn::wheel_torque,
      "F = a m_p g, half on each wheel, opposing its rotation",
      "hard floor, payload over the axle",
      "thesis (1-3), F_r = m g f_r; tables 3-3 and 3-4 show that T_m grows with payload",
      parameters};

  static void load(const auto& a, const auto& c, auto& loads) {
    for (std::size_t s : {0u, 1u})
      loads.wheel(Load::rolling, s,
                  a[0] * c.payload_weight_n * c.parameters.wheel_radius_m[s] * 0.5 * c.direction[s]);
  }
};

struct FloorResistanceZone {
  static constexpr EffectParameter parameters[] = {
      {"coefficient", "1", 0, 0, 0.5, "extra rolling resistance inside"},
      {"x_m", "m", 0, -1000, 1000, "centre"},
      {"y_m", "m", 0, -1000, 1000, "centre"},
      {"radius_m", "m", 3, 0.2, 1000, "radius"}};
  static constexpr EffectInfo info{
      "floor_resistance_zone",
      ActsOn::wheel_torque,
      "F = a m g inside a disc of the floor, half on each wheel, opposing its rotation",
      "carpet, ramps of rubber, dirt: a patch that stays",
      "thesis (1-3), F_r = m g f_r",
      parameters,
      true,
      false};

  static void load(const auto& a, const auto& c, auto& loads) {
    const double dx = c.at.x_m - value_of(a[1]), dy = c.at.y_m - value_of(a[2]), radius = value_of(a[3]);
    if (!(dx * dx + dy * dy <= radius * radius)) return;  // also when the position is unknown
    for (std::size_t s : {0u, 1u})
      loads.wheel(Load::zone, s, a[0] * c.weight_n * c.parameters.wheel_radius_m[s] * 0.5 * c.direction[s]);
  }
};

struct Slope {
  static constexpr EffectParameter parameters[] = {
      {"angle_rad", "rad", 0, 0, 0.3, "tilt of the floor"},
      {"uphill_rad", "rad", 0, -7, 7, "heading in which the floor rises"}};
  static constexpr EffectInfo info{"slope",
                                   ActsOn::wheel_torque,
                                   "F = m g sin(a) cos(heading - b)",
                                   "a plane floor, small tilt",
                                   "thesis (1-3), F_g = m g sin(alpha)",
                                   parameters,
                                   false,
                                   true};

  static void load(const auto& a, const auto& c, auto& loads) {
    if (!std::isfinite(c.at.heading_rad)) return;
    c.force(loads, Load::potential, c.weight_n * sin(a[0]) * cos(c.at.heading_rad - a[1]));
  }
};

struct Grade {
  static constexpr EffectParameter parameters[] = {
      {"share", "1", 0, 0, 2, "of the climb's force that counts; 1: the whole of it"},
      {"zero_rad", "rad", 0, -0.2, 0.2, "added to the climb: by how much the pitch reads low"}};
  static constexpr EffectInfo info{"grade",
                                   ActsOn::wheel_torque,
                                   "F = a m g sin(climb + b)",
                                   "a floor of any shape whose climb is known: pitch, or height over the way",
                                   "thesis (1-3), F_g = m g sin(alpha)",
                                   parameters,
                                   false,
                                   false,
                                   true};

  static void load(const auto& a, const auto& c, auto& loads) {
    if (!std::isfinite(c.at.climb_rad)) return;
    c.force(loads, Load::potential, a[0] * c.weight_n * sin(c.at.climb_rad + a[1]));
  }
};

struct AerodynamicDrag {
  static constexpr EffectParameter parameters[] = {
      {"coefficient_n_s2_m2", "N s^2/m^2", 0, 0, 1000, "drag over speed squared"}};
  static constexpr EffectInfo info{"aerodynamic_drag", ActsOn::wheel_torque, "F = a v |v|, a = rho A C / 2",
                                   "still air",        "thesis (1-3), F_a",  parameters};

  static void load(const auto& a, const auto& c, auto& loads) {
    const auto v = c.body.speed_m_s;
    c.force(loads, Load::drag, a[0] * v * abs(v));
  }
};

struct TurningScrub {
  static constexpr EffectParameter parameters[] = {
      {"coefficient", "1", 0, 0, 3, "friction coefficient of the twisting contacts"},
      {"rate_rad_s", "rad/s", 0.02, 0.001, 2, "yaw rate at which the moment has built up"}};
  static constexpr EffectInfo info{
      "turning_scrub",
      ActsOn::wheel_torque,
      "M = a (m g l / 2) tanh(yaw / b), opposing the turn",
      "tyres and castors twisting on the floor; saturated above creeping yaw rates",
      "Morales et al., Power analysis for a skid-steered tracked mobile robot, 2006",
      parameters};

  static void load(const auto& a, const auto& c, auto& loads) {
    c.moment(loads, Load::scrub,
             a[0] * c.weight_n * c.parameters.half_track_m * 0.5 * tanh(c.body.yaw_rate_rad_s / a[1]));
  }
};

struct GearEfficiency {
  static constexpr EffectParameter parameters[] = {
      {"loss", "1", 0, 0, 0.9, "fraction of the transmitted torque lost"},
      {"of_friction", "1", 0, 0, 1,
       "share of T_m and viscous friction that the gear passes on: 0 where "
       "they act at the motor, 1 where at the wheel"}};
  static constexpr EffectInfo info{
      "gear_efficiency",
      ActsOn::wheel_torque,
      "T = tau + f + a |tau + b f| sgn(w), tau the torque passed on, f the drive's own friction",
      "steady mesh; driving and braking alike",
      "Giberti, Cinquemani and Legnani, Effects of transmission mechanical characteristics, 2010",
      parameters};

  static void adjust(const auto& a, auto& p) {
    p.gear_loss += a[0];
    p.gear_friction_share = a[1];
  }
};

}  // namespace joulecast::dynamics
