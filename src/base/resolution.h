#pragma once

namespace joulecast {

// Numbers of answers nearer to 0 than this are 0: in SI units no quantity and no probability that the service
// tells is known so finely, and what a far tail leaves (1e-223) reads like a value.
inline constexpr double answer_resolution = 1e-18;

constexpr double resolved(double value) {
  return value < answer_resolution && value > -answer_resolution ? 0.0 : value;
}

}  // namespace joulecast
