#pragma once

namespace joulecast {

// Numbers of answers nearer to 0 than this are 0: in SI units no quantity and no probability of the service
// is this accurate, and the remainder of a far tail (1e-223) looks like a value.
inline constexpr double answer_resolution = 1e-18;

constexpr double resolved(double value) {
  return value < answer_resolution && value > -answer_resolution ? 0.0 : value;
}

}  // namespace joulecast
