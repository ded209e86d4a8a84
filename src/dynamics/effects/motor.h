#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct ResistanceError {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.99, 20, "error of the armature resistance over its nominal value"}};
  static constexpr EffectInfo info{"resistance_error",     ActsOn::motor,      "R (1 + a)",
                                   "constant temperature", "thesis (2-32), R", parameters};

  static void adjust(const auto& a, auto& p) {
    for (auto& ohm : p.resistance_ohm) ohm *= 1.0 + a[0];
  }
};

struct WindingTemperature {
  static constexpr EffectParameter parameters[] = {
      {"thermal_resistance_k_w", "K/W", 0, 0, 300, "winding over ambient"},
      {"time_constant_s", "s", 600, 10, 7200, "of the winding"}};
  static constexpr EffectInfo info{
      "winding_temperature",
      ActsOn::motor,
      "R (1 + 0.00393 a q), q = R i^2 low-passed over b",
      "one thermal mass for each winding",
      "copper: 0.393 % per kelvin; Hughes and Drury, Electric Motors and Drives, ch. 3",
      parameters};

  static void adjust(const auto& a, auto& p) {
    p.thermal_resistance_k_w += a[0];
    p.thermal_time_constant_s = value_of(a[1]);
  }
};

struct BrushDrop {
  static constexpr EffectParameter parameters[] = {{"voltage_v", "V", 0, 0, 20, "across both brushes"}};
  static constexpr EffectInfo info{"brush_drop",
                                   ActsOn::motor,
                                   "V + a sgn(i)",
                                   "brushed motors",
                                   "Hughes and Drury, Electric Motors and Drives, section 3.3",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.brush_drop_v += a[0]; }
};

struct TorqueConstantLoss {
  static constexpr EffectParameter parameters[] = {
      {"loss", "1", 0, -0.5, 0.8, "fraction of the constant lost"},
      {"voltage_share", "1", 1, 0, 1, "how much of the loss the voltage constant shares"}};
  static constexpr EffectInfo info{
      "torque_constant_loss",       ActsOn::motor,
      "K_t (1 - a), K_w (1 - b a)", "magnets warm or aged; in SI units both constants fall together (b = 1)",
      "thesis (2-32), K_t and K_w", parameters};

  static void adjust(const auto& a, auto& p) {
    p.torque_constant_nm_a *= 1.0 - a[0];
    p.voltage_constant_v_s_rad *= 1.0 - a[1] * a[0];
  }
};

struct Inductance {
  static constexpr EffectParameter parameters[] = {{"inductance_h", "H", 0, 0, 1, "armature inductance"}};
  static constexpr EffectInfo info{
      "inductance", ActsOn::motor, "V + a di/dt", "mean-value drivers", "thesis (2-32), L, dropped in (2-33)",
      parameters};

  static void adjust(const auto& a, auto& p) { p.inductance_h += a[0]; }
};

}  // namespace joulecast::dynamics
