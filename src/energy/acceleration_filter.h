#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace joulecast::energy {

// Angular acceleration of both wheels from their speeds: at each sample, the slope of the quadratic that fits
// the speeds within +-half_window_s best (least squares; times need not be equidistant).
//   Latency: half_window_s, the filter looks that far ahead.
//   Bias: none for speeds that are quadratic over the window. For w = sin(2 pi f t) and x = 2 pi f
//   half_window_s the slope
//     comes out as 3 (sin x - x cos x)/x^3 of the true one (dense samples): -3.9 % at x = 0.63 (1 Hz with 0.1
//     s), -14 % at 2 Hz.
//   Noise: white speed noise of sd s at interval h gives a slope of sd s sqrt(3 / (2 n^3)) / h for n =
//   half_window_s / h
//     samples on each side: 0.011 rad/s at 50 Hz with 0.1 s gives 0.06 rad/s^2; the bare difference gives
//     0.78.
// At the ends of a record the window is one-sided and the fit falls back to a line.
inline constexpr double default_half_window_s = 0.1;

struct SpeedSample {
  double t_s = 0;
  std::array<double, 2> speed_rad_s{};
};

// The slope at window[at]. `window` holds the samples inside +-half_window_s around it, in time order.
// A single sample gives zero.
std::array<double, 2> fitted_acceleration(std::span<const SpeedSample> window, std::size_t at);

}  // namespace joulecast::energy
