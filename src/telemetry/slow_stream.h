#pragma once

#include <fmt/format.h>

#include <string>

namespace joulecast::telemetry {

// With virtual robots copper is 12 % and braking 15 % too small at 4 Hz, 3.5 and 4 % at 10 Hz
// (for_operators.md).
inline constexpr double slow_rate_hz = 5;

// A sentence on telemetry at a rate that is too low for accounts of currents; empty at others.
inline std::string slow_stream(double rate_hz) {
  if (!(rate_hz < slow_rate_hz)) return "";
  return fmt::format(
      "is a slow stream of {:.3g} Hz: currents between samples are not measured, so copper and braking are "
      "underestimated",
      rate_hz);
}

}  // namespace joulecast::telemetry
