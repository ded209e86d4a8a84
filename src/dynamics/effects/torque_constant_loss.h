#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct TorqueConstantLoss {
  static constexpr std::array parameters = std::to_array<EffectParameter>(
      {{"loss", "1", 0, -0.5, 0.8, "fraction of the constant lost"},
       {"voltage_share", "1", 1, 0, 1, "how much of the loss the voltage constant shares"}});
  static constexpr EffectInfo info{
      "torque_constant_loss",       ActsOn::motor,
      "K_t (1 - a), K_w (1 - b a)", "magnets warm or aged; in SI units both constants fall together (b = 1)",
      "thesis (2-32), K_t and K_w", parameters};

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.torque_constant_nm_a *= S(1) - a[0];
    p.voltage_constant_v_s_rad *= S(1) - a[1] * a[0];
  }
};

}  // namespace joulecast::dynamics
