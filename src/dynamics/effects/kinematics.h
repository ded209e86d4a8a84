#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct WheelRadiusError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.6, 1.5, "error of both radii over the nominal one"}};
  static constexpr EffectInfo info{
      "wheel_radius_error",
      ActsOn::kinematics,
      "r (1 + a), both wheels",
      "worn or soft tyres",
      "Borenstein and Feng, Measurement and correction of systematic odometry errors, 1996",
      parameters};

  static void adjust(const auto& a, auto& p) {
    for (auto& radius : p.wheel_radius_m) radius *= 1.0 + a[0];
  }
};

struct WheelRadiusAsymmetry {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.5, 0.5, "difference of the radii over the nominal one"}};
  static constexpr EffectInfo info{"wheel_radius_asymmetry",
                                   ActsOn::kinematics,
                                   "r_right (1 + a/2), r_left (1 - a/2)",
                                   "unequal wear or load",
                                   "Borenstein and Feng 1996, E_d",
                                   parameters};

  static void adjust(const auto& a, auto& p) {
    p.wheel_radius_m[0] *= 1.0 + a[0] * 0.5;
    p.wheel_radius_m[1] *= 1.0 - a[0] * 0.5;
  }
};

struct TrackError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.7, 2, "error of the track over its nominal value"}};
  static constexpr EffectInfo info{"track_error",
                                   ActsOn::kinematics,
                                   "l (1 + a)",
                                   "effective contact width",
                                   "Borenstein and Feng 1996, E_b",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.half_track_m *= 1.0 + a[0]; }
};

struct WheelSlip {
  static constexpr EffectParameter parameters[] = {
      {"slip", "1", 0, -0.2, 0.8, "part of the wheel travel that moves nothing"}};
  static constexpr EffectInfo info{"wheel_slip",
                                   ActsOn::kinematics,
                                   "v = (1 - a) r w",
                                   "small constant slip of both wheels",
                                   "Wong, Theory of Ground Vehicles, section 1.3",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.slip += a[0]; }
};

}  // namespace joulecast::dynamics
