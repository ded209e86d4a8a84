#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

namespace joulecast::virtual_robot {

// Deviations of the plant from its robot file. One strength per effect, 0 = none. Fractions unless a unit is
// named. Ids are the catalogue's; those that begin with x_ are effects that no catalogue contains.
struct Imperfections {
#define IMPERFECTION(name, unit, search_limit) double name = 0;
#include "client/virtual_robot/imperfections.def"
#undef IMPERFECTION
};

// Shapes that the strengths do not determine.
struct World {
  double zone_x_m = 0, zone_y_m = 0, zone_radius_m = 3.5;
  double slope_direction_rad = 0;  // heading in which the floor rises
  int weak_side = 0;               // 0 right, 1 left
  double stribeck_speed_m_s = 0.12;
  double stribeck_power = 1;   // of the speed in the exponential
  double bristle_rad = 0.006;  // wheel angle over which dry friction builds up
  double emf_loss_share = 1;  // of torque_constant_loss that K_w has too; in SI units magnets cost both alike
  double thermal_time_constant_s = 240;
  double period_s = 24;
  double burst_time_s = 20;
  double patch_m = 1.2;
  double hill_m = 8;          // from top to top, k = 2 pi / hill_m
  double brush_softness = 1;  // of the current over which the brush drop builds up
  double motor_sensor_share = 1, battery_sensor_share = 1;  // of gains and biases of electrical sensors
};

struct EffectEntry {
  std::string_view id;
  double Imperfections::*strength;
  std::string_view unit;  // "1" for fractions
  double search_limit;    // the strongest that a search for a strength tries
  bool outside;           // beyond the catalogue
};

// Every injectable effect.
[[nodiscard]] std::span<const EffectEntry> all_effects();

using EffectStrength = std::pair<std::string, double>;

// Fault::invalid naming the unknown id, or a strength that is not finite.
[[nodiscard]] Result<Imperfections> make_imperfections(const std::vector<EffectStrength>& effects);
// Those of nonzero strength, in table order.
[[nodiscard]] std::vector<EffectStrength> effects_of(const Imperfections& imperfections);

}  // namespace joulecast::virtual_robot
