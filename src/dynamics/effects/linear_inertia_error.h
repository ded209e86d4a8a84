#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct LinearInertiaError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.8, 5, "error of the translational inertia over the mass"}});
  static constexpr EffectInfo info{
      "linear_inertia_error", ActsOn::inertia,
      "F = m (1 + a) dv/dt",  "rotating parts or sloshing load that add inertia without weight",
      "thesis (2-31), m",     parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.inertial_factor += a[0];
  }
};

}  // namespace joulecast::dynamics
