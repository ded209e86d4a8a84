#pragma once

#include "dynamics/sensor_gain.h"

namespace joulecast::dynamics {

struct VoltageSensorGain {
  static constexpr EffectInfo info = sensor_gain_info("voltage_sensor_gain");

  template <class S>
  static void adjust(const EffectValues<S>& a, Parameters<S>& p) {
    p.motor_voltage.gain += a[0] * a[1];
    p.battery_voltage.gain += a[0] * a[2];
  }
};

}  // namespace joulecast::dynamics
