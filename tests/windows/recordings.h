#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "telemetry/recording.h"

// Recordings computed from formulas.
namespace joulecast::testing {

constexpr std::int64_t start_us = 1'700'000'000'000'000;

// A mission of `samples` at a rate. `fill` receives the time since the start [s] and a sample with that time.
inline telemetry::Recording recorded(std::size_t samples, double rate_hz,
                                     const std::function<void(double, signals::Sample&)>& fill) {
  telemetry::Recording mission;
  mission.robot_id = "nomad";
  mission.mission_id = "made";
  for (std::size_t k = 0; k < samples; ++k) {
    const std::int64_t us = std::llround(1e6 * static_cast<double>(k) / rate_hz);
    signals::Sample s;
    s.utime_us = start_us + us;
    s.sequence = static_cast<std::int64_t>(k);
    fill(1e-6 * static_cast<double>(us), s);
    mission.samples.push_back(s);
  }
  return mission;
}

// Removes the samples in [from, to) seconds.
inline telemetry::Recording without(telemetry::Recording mission, double from, double to) {
  std::erase_if(mission.samples, [&](const signals::Sample& s) {
    const double t = 1e-6 * static_cast<double>(s.utime_us - start_us);
    return t >= from && t < to;
  });
  return mission;
}

}  // namespace joulecast::testing
