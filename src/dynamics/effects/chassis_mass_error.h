#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct ChassisMassError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -0.8, 3, "error of the chassis mass over its nominal value"}});
  static constexpr EffectInfo info{"chassis_mass_error", ActsOn::inertia, "m_c (1 + a)",
                                   "rigid chassis",      "thesis (2-31)", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.chassis_kg *= S(1) + a[0];
  }
};

}  // namespace joulecast::dynamics
