#pragma once

#include <bit>
#include <cstdint>

#include "signals/sample.h"

namespace joulecast::telemetry::test {

// All fields differ; two are unmeasured.
inline signals::Sample distinct_sample() {
  signals::Sample s;
  s.utime_us = 1'700'000'000'123'456;
  s.sequence = 42;
  s.wheel_velocity_rad_s = {1.25, -2.5};
  s.motor_voltage_v = {3, 4};
  s.motor_current_a = {5, 6};
  s.battery_voltage_v = 24.5;
  s.battery_current_a = -7;
  s.velocity_command = {0.75, -0.125};
  s.yaw_rate_rad_s = 0.375;
  s.pitch_rad = signals::unmeasured;
  s.pose = {10, -11, 2};
  s.motor_temperature_c = {55, signals::unmeasured};
  s.payload_kg = 12.5;
  return s;
}

// Equal bit by bit, so that NaN equals NaN and -0 differs from 0.
inline bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

template <std::size_t N>
bool same_bits(const std::array<double, N>& a, const std::array<double, N>& b) {
  for (std::size_t i = 0; i < N; ++i) {
    if (!same_bits(a[i], b[i])) return false;
  }
  return true;
}

inline bool same_bits(const signals::Sample& a, const signals::Sample& b) {
  return a.utime_us == b.utime_us && a.sequence == b.sequence &&
         same_bits(a.wheel_velocity_rad_s, b.wheel_velocity_rad_s) &&
         same_bits(a.motor_voltage_v, b.motor_voltage_v) && same_bits(a.motor_current_a, b.motor_current_a) &&
         same_bits(a.battery_voltage_v, b.battery_voltage_v) &&
         same_bits(a.battery_current_a, b.battery_current_a) &&
         same_bits(a.velocity_command, b.velocity_command) && same_bits(a.yaw_rate_rad_s, b.yaw_rate_rad_s) &&
         same_bits(a.pitch_rad, b.pitch_rad) && same_bits(a.pose, b.pose) &&
         same_bits(a.motor_temperature_c, b.motor_temperature_c) && same_bits(a.payload_kg, b.payload_kg);
}

}  // namespace joulecast::telemetry::test
