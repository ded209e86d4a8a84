#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace joulecast::energy {

// Angular acceleration of both wheels from their speeds: at each sample, the slope of the quadratic that fits
// the speeds around it best (least squares; times need not be equidistant). The window reaches half_window_s
// to each side and to the neighbouring samples at least, so that it scales with slow rates: with n samples at
// interval h on each side, n = max(1, round(half_window_s / h)).
//   Latency: n h, the filter looks that far ahead: 0.1 s from 10 to 200 Hz, one interval below.
//   Bias: none for speeds that are quadratic over the window. Of w = sin(2 pi f t), with x = 2 pi f h, the
//   slope comes out
//     as 3 sum_{k=1..n} k sin(k x) / (x n (n + 1) (n + 1/2)) of the true one:
//       10 Hz (n = 1) sin(x)/x:   -6.5 % at 1 Hz, -24 % at 2 Hz
//       50 Hz (n = 5):            -4.6 % at 1 Hz, -17 % at 2 Hz
//       200 Hz (n = 20):          -4.1 % at 1 Hz, -15 % at 2 Hz (the dense limit: 3 (sin y - y cos y)/y^3, y
//       = n x)
//   Noise: white speed noise of sd s gives a slope of sd s / (h sqrt(n (n + 1) (2 n + 1) / 3)). For s = 0.011
//   rad/s:
//     0.08 rad/s^2 at 10 Hz, 0.05 at 50 Hz, 0.03 at 200 Hz; differences of neighbours give 0.16, 0.78
//     and 3.1.
// At the ends of a record the window is one-sided and the fit falls back to a line.
inline constexpr double default_half_window_s = 0.1;

struct SpeedSample {
  double t_s = 0;
  std::array<double, 2> speed_rad_s{};
};

// The slope at window[at]; `window` is in time order. A single sample gives zero.
std::array<double, 2> fitted_acceleration(std::span<const SpeedSample> window, std::size_t at);

}  // namespace joulecast::energy
