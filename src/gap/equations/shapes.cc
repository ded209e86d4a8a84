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
Variants by_second(EffectValues<double> v, std::span<const double> values, double against) {
  Variants variants;
  for (const double value : values) {
    v[1] = value;
    variants.push_back({v, 0, against});
  }
  return variants;
}

Variants zones(EffectValues<double> v, const ShapeSetting& s) {
  // The prior odds of a searched place are divided by this.
  constexpr double searched = 50;
  Variants variants;
  if (!s.ranges.position) return variants;
  for (const Zone& zone : s.shapes.zones) {
    v = {0, zone.x_m, zone.y_m, zone.radius_m, 0};
    variants.push_back({v, 0, searched * static_cast<double>(s.shapes.zones.size())});
  }
  return variants;
}

Variants stribeck(EffectValues<double> v, const dynamics::EffectParameter& bounds, const ShapeSetting& s) {
  constexpr std::array parts_of_top_speed{0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4};
  std::vector<double> speeds_rad_s;
  for (const double speed_m_s : s.shapes.stribeck_speeds_m_s)
    speeds_rad_s.push_back(speed_m_s / s.robot.kinematics.wheel_radius_m);
  if (speeds_rad_s.empty()) {
    for (const double part : parts_of_top_speed) speeds_rad_s.push_back(part * s.ranges.wheel_speed_rad_s);
  }
  std::erase_if(speeds_rad_s, [&](double speed) { return speed < bounds.minimum || speed > bounds.maximum; });
  Variants variants;
  for (const double speed_rad_s : speeds_rad_s) {
    for (const double exponent : s.shapes.stribeck_exponents) {
      v[1] = speed_rad_s;
      v[2] = exponent;
      variants.push_back({v, 0, 6});
    }
  }
  return variants;
}

// Variants of both motors' and the battery's sensors, the motors' alone and the battery's alone.
Variants sensors(EffectValues<double> v, bool is_bias, const ShapeSetting& s) {
  // An error of the battery's sensor alone looks like a load that follows the current. Where only the
  // battery's sensor is available, a bias is a load, and a load that no file has is more common.
  constexpr double battery_alone = 40, motors = 3, bias = 3;
  Variants variants;
  for (const auto& [of_motors, of_battery] : {std::pair{1.0, 1.0}, {1.0, 0.0}, {0.0, 1.0}}) {
    v[1] = of_motors;
    v[2] = of_battery;
    if (s.from_motion.power && of_motors * of_battery == 0) continue;  // battery's sensor only
    variants.push_back({v, 0,
                        s.from_motion.power ? (is_bias ? bias : 1)
                        : of_motors > 0     ? motors
                                            : battery_alone});
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
    return {{v, 0, 1, true}};
  }
  if (id == "grade" && !s.ranges.climb) return {};
  if (!s.from_motion.kinematics && is_kinematic(id)) return {};
  if (id == "coulomb_friction") {
    const auto& torque = s.robot.motor.friction_torque_nm;
    return ratio_or_own(v, (torque[0] + torque[1]) * s.ranges.mean_wheel_speed_rad_s, s);
  }
  if (id == "viscous_friction") {
    const double speed = s.ranges.mean_wheel_speed_rad_s;
    return ratio_or_own(v, 2 * s.robot.motor.viscous_friction_nm_s_rad * speed * speed, s);
  }
  if (id == "stribeck_friction") return stribeck(v, effect.info().parameters[1], s);
  if (id == "turning_scrub") return by_second(v, s.shapes.scrub_rates_rad_s, 4);
  if (id == "winding_temperature") return by_second(v, s.shapes.winding_time_constants_s, 6);
  if (id == "friction_asymmetry" || id == "torque_constant_loss" || id == "gear_efficiency")
    return by_second(v, std::array{1.0, 0.0}, 2);
  if (id == "payload_mass_error") {
    std::vector<Variant> variants{{v, 1, 8}};
    if (s.ranges.payload_kg > 1) variants.push_back({v, 0, 1});
    return variants;
  }
  if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain")
    return sensors(v, id == "current_sensor_bias", s);
  if (id == "load_rolling_resistance" && !(s.ranges.payload_kg > 1)) return {};
  return {{v}};
}

}  // namespace joulecast::gap
