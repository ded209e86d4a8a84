#include "gap/equations/shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace joulecast::gap {
namespace {

using dynamics::EffectValues;
using Variants = std::vector<Variant>;

// Strengths that are ratios to a parameter of the robot file are undefined where that is close to zero: there
// the effect's own parameter is used. A parameter is close to zero if ten times its value moves less than
// this part of the mean power.
constexpr double least_share = 0.01, tenfold = 10;
constexpr std::array stribeck_parts{0.05, 0.1, 0.2, 0.4};  // of the fastest wheel speed
constexpr std::array scrub_rates_rad_s{0.02, 0.2};
constexpr std::array winding_s{120.0, 480.0};

constexpr auto kinematic = std::to_array<std::string_view>(
    {"wheel_radius_error", "wheel_radius_asymmetry", "track_error", "wheel_slip", "com_offset"});

EffectValues<double> initial_values(const dynamics::Effect& effect) {
  EffectValues<double> v = dynamics::initial(effect).values;
  v[0] = 0;
  return v;
}

Variants ratio_or_own(const EffectValues<double>& v, double nominal_w, const ShapeSetting& s) {
  return {{v, tenfold * nominal_w > least_share * s.ranges.mean_power_w ? std::size_t{0} : std::size_t{1}}};
}

// One variant for each value of the second parameter.
Variants by_second(EffectValues<double> v, std::span<const double> values) {
  Variants variants;
  for (const double value : values) {
    v[1] = value;
    variants.push_back({v});
  }
  return variants;
}

Variants zones(EffectValues<double> v, const ShapeSetting& s) {
  Variants variants;
  if (!s.ranges.position) return variants;
  for (const Zone& zone : s.zones) {
    v = {0, zone.x_m, zone.y_m, zone.radius_m, 0};
    variants.push_back({v});
  }
  return variants;
}

Variants stribeck(EffectValues<double> v, const dynamics::EffectParameter& bounds, double fastest_rad_s) {
  Variants variants;
  for (const double part : stribeck_parts) {
    v[1] = part * fastest_rad_s;
    v[2] = 2;
    if (v[1] >= bounds.minimum && v[1] <= bounds.maximum) variants.push_back({v});
  }
  return variants;
}

// Variants of both motors' and the battery's sensors, the motors' alone and the battery's alone.
Variants sensors(EffectValues<double> v, bool battery_alone) {
  Variants variants;
  for (const auto& [of_motors, of_battery] : {std::pair{1.0, 1.0}, {1.0, 0.0}, {0.0, 1.0}}) {
    if (battery_alone && of_motors * of_battery == 0) continue;
    v[1] = of_motors;
    v[2] = of_battery;
    variants.push_back({v});
  }
  return variants;
}

}  // namespace

bool is_kinematic(std::string_view id) {
  return std::ranges::find(kinematic, id) != kinematic.end();
}

std::vector<Variant> variants_of(const dynamics::Effect& effect, const ShapeSetting& s) {
  const std::string_view id = effect.info().id;
  const EffectValues<double> v = initial_values(effect);
  if (id == "floor_resistance_zone") return zones(v, s);
  if (id == "slope") {
    if (!s.ranges.heading) return {};
    return {{v, 0, true}};
  }
  if (id == "grade" && !s.ranges.climb) return {};
  if (id == "coulomb_friction") {
    const auto& torque = s.robot.motor.friction_torque_nm;
    return ratio_or_own(v, (torque[0] + torque[1]) * s.ranges.mean_wheel_speed_rad_s, s);
  }
  if (id == "viscous_friction") {
    const double speed = s.ranges.mean_wheel_speed_rad_s;
    return ratio_or_own(v, 2 * s.robot.motor.viscous_friction_nm_s_rad * speed * speed, s);
  }
  if (id == "stribeck_friction") return stribeck(v, effect.info().parameters[1], s.fastest_rad_s);
  if (id == "turning_scrub") return by_second(v, scrub_rates_rad_s);
  if (id == "winding_temperature") return by_second(v, winding_s);
  if (id == "friction_asymmetry" || id == "torque_constant_loss" || id == "gear_efficiency")
    return by_second(v, std::array{1.0, 0.0});
  if (id == "payload_mass_error") {
    std::vector<Variant> variants{{v, 1}};
    if (s.ranges.payload_kg > 1) variants.push_back({v});
    return variants;
  }
  if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain")
    return sensors(v, s.battery_alone);
  if (id == "load_rolling_resistance" && !(s.ranges.payload_kg > 1)) return {};
  return {{v}};
}

}  // namespace joulecast::gap
