#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct ChassisMassError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.8, 3, "error of the chassis mass over its nominal value"}};
  static constexpr EffectInfo info{"chassis_mass_error", ActsOn::inertia, "m_c (1 + a)",
                                   "rigid chassis",      "thesis (2-31)", parameters};

  static void adjust(const auto& a, auto& p) { p.chassis_kg *= 1.0 + a[0]; }
};

struct PayloadMassError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -1, 10, "error over the declared payload"},
      {"extra_kg", "kg", 0, -500, 1000, "payload that was not declared", true}};
  static constexpr EffectInfo info{"payload_mass_error",        ActsOn::inertia,
                                   "m_p (1 + a) + b",           "payload over the axle",
                                   "thesis section 2.1.1, m_p", parameters};

  static void adjust(const auto& a, auto& p) {
    p.payload_factor += a[0];
    p.payload_extra_kg += a[1];
  }
};

struct YawInertiaError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.9, 20,
       "error of the robot file's yaw inertia over its value; a payload's is not scaled"}};
  static constexpr EffectInfo info{"yaw_inertia_error", ActsOn::inertia,    "I (1 + a)",
                                   "rigid body",        "thesis (2-12), I", parameters};

  static void adjust(const auto& a, auto& p) { p.yaw_inertia_kg_m2 *= 1.0 + a[0]; }
};

struct LinearInertiaError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.8, 5, "error of the translational inertia over the mass"}};
  static constexpr EffectInfo info{
      "linear_inertia_error", ActsOn::inertia,
      "F = m (1 + a) dv/dt",  "rotating parts or sloshing load that add inertia without weight",
      "thesis (2-31), m",     parameters};

  static void adjust(const auto& a, auto& p) { p.inertial_factor += a[0]; }
};

struct ComOffset {
  static constexpr EffectParameter parameters[] = {
      {"offset_m", "m", 0, -1, 1, "centre of mass further ahead of the axle"}};
  static constexpr EffectInfo info{
      "com_offset",       ActsOn::inertia, "d + a", "centre of mass on the axis of symmetry",
      "thesis (2-12), d", parameters};

  static void adjust(const auto& a, auto& p) { p.com_offset_m += a[0]; }
};

}  // namespace joulecast::dynamics
