#pragma once

#include "dynamics/effect.h"

namespace joulecast::dynamics {

// Common to the gains of current and of voltage sensors.
inline constexpr EffectParameter sensor_gain_parameters[] = {
    {"gain", "1", 0, -0.5, 0.5, "error of the reading"},
    {"motors", "1", 1, 0, 1, "share that the motor sensors have of it"},
    {"battery", "1", 1, 0, 1, "share that the battery sensor has of it"}};

constexpr EffectInfo sensor_gain_info(std::string_view id) {
  return {id,
          ActsOn::sensors,
          "reading = (1 + a) truth",
          "linear sensors",
          "ISO/IEC Guide 98-3 (GUM), systematic effects",
          sensor_gain_parameters};
}

struct CurrentSensorGain {
  static constexpr EffectInfo info = sensor_gain_info("current_sensor_gain");

  static void adjust(const auto& a, auto& p) {
    p.motor_current.gain += a[0] * a[1];
    p.battery_current.gain += a[0] * a[2];
  }
};

struct CurrentSensorBias {
  static constexpr EffectParameter parameters[] = {
      {"bias_a", "A", 0, -20, 20, "error of the reading"},
      {"motors", "1", 1, 0, 1, "share that the motor sensors have of it"},
      {"battery", "1", 1, 0, 1, "share that the battery sensor has of it"}};
  static constexpr EffectInfo info{"current_sensor_bias",
                                   ActsOn::sensors,
                                   "reading = truth + a",
                                   "linear sensors",
                                   "ISO/IEC Guide 98-3 (GUM), systematic effects",
                                   parameters};

  static void adjust(const auto& a, auto& p) {
    p.motor_current.bias += a[0] * a[1];
    p.battery_current.bias += a[0] * a[2];
  }
};

struct VoltageSensorGain {
  static constexpr EffectInfo info = sensor_gain_info("voltage_sensor_gain");

  static void adjust(const auto& a, auto& p) {
    p.motor_voltage.gain += a[0] * a[1];
    p.battery_voltage.gain += a[0] * a[2];
  }
};

struct SensorDelay {
  static constexpr EffectParameter parameters[] = {
      {"delay_s", "s", 0, -0.5, 0.5, "by which electrical channels lag the encoders"}};
  static constexpr EffectInfo info{"sensor_delay",
                                   ActsOn::sensors,
                                   "electrical reading(t) = truth(t - a)",
                                   "delay below the time constants of motion",
                                   "Ljung, System Identification, section 14.5",
                                   parameters};

  static void adjust(const auto& a, auto& p) { p.sensor_delay_s += a[0]; }
};

}  // namespace joulecast::dynamics
