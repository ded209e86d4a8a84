#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

struct AccessoryLoad {
  static constexpr EffectParameter parameters[] = {{"power_w", "W", 0, -2000, 20000, "extra constant power"}};
  static constexpr EffectInfo info{
      "accessory_load",
      ActsOn::battery_side,
      "P + a",
      "constant while the robot is on",
      "Mei et al., Deployment of mobile robots with energy and timing constraints, 2006",
      parameters};

  static void adjust(const auto& a, auto& p) { p.accessory_power_w += a[0]; }
};

struct DriverLoss {
  static constexpr EffectParameter parameters[] = {{"fraction", "1", 0, 0, 1, "of the absolute motor power"}};
  static constexpr EffectInfo info{"driver_loss",
                                   ActsOn::battery_side,
                                   "P + a |V i| for each motor",
                                   "switching and conduction losses together",
                                   "Mohan, Undeland and Robbins, Power Electronics, ch. 2",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.driver_loss += a[0]; }
};

struct NoRegeneration {
  static constexpr EffectParameter parameters[] = {
      {"fraction", "1", 0, 0, 1, "of the braking power that is not returned"}};
  static constexpr EffectInfo info{"no_regeneration",
                                   ActsOn::battery_side,
                                   "braking power of each motor reaches the battery as (1 - a)",
                                   "a = 1: all burnt in a resistor or blocked",
                                   "the thesis returns all of it, (2-46)",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.unreturned += a[0]; }
};

struct BatteryResistance {
  static constexpr EffectParameter parameters[] = {
      {"ratio", "1", 0, -0.9, 20, "error of the internal resistance over its nominal value"}};
  static constexpr EffectInfo info{"battery_resistance",
                                   ActsOn::battery_side,
                                   "V_t = V_oc - (1 + a) R_b i",
                                   "ohmic part only",
                                   "Plett, Battery Management Systems I, ch. 2",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.battery_resistance_ohm *= 1.0 + a[0]; }
};

}  // namespace joulecast::dynamics
