#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct FloorResistanceZone {
  static constexpr std::array parameters =
      std::to_array<EffectParameter>({{"coefficient", "1", 0, 0, 0.5, "extra rolling resistance inside"},
                                      {"x_m", "m", 0, -1000, 1000, "centre"},
                                      {"y_m", "m", 0, -1000, 1000, "centre"},
                                      {"radius_m", "m", 3, 0.2, 100, "radius"}});
  static constexpr EffectInfo info{
      "floor_resistance_zone",
      ActsOn::wheel_torque,
      "F = a m g inside a disc of the floor, half on each wheel, opposing its rotation",
      "carpet, ramps of rubber, dirt: a patch that stays",
      "thesis (1-3), F_r = m g f_r",
      parameters,
      true,
      false};

  template <class S>
  static void load(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& loads) {
    const double dx = c.at.x_m - value_of(a[1]), dy = c.at.y_m - value_of(a[2]), radius = value_of(a[3]);
    if (!(dx * dx + dy * dy <= radius * radius)) return;  // also when the position is unknown
    for (std::size_t s : {0u, 1u})
      loads.wheel(Load::zone, s, a[0] * c.weight_n * c.parameters.wheel_radius_m[s] * 0.5 * c.direction[s]);
  }
};

}  // namespace joulecast::dynamics
