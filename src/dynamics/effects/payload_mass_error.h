#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct PayloadMassError {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"ratio", "1", 0, -1, 10, "error over the declared payload"},
       {"extra_kg", "kg", 0, -500, 1000, "payload that was not declared", true}});
  static constexpr EffectInfo info{"payload_mass_error",        ActsOn::inertia,
                                   "m_p (1 + a) + b",           "payload over the axle",
                                   "thesis section 2.1.1, m_p", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.payload_factor += a[0];
    p.payload_extra_kg += a[1];
  }
};

}  // namespace joulecast::dynamics
