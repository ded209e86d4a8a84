#include "energy/acceleration_filter.h"

namespace joulecast::energy {

std::array<double, 2> fitted_acceleration(std::span<const SpeedSample> window, std::size_t at) {
  const std::size_t n = window.size();
  if (n < 2) return {};
  const double origin = window[at].t_s;
  double s1 = 0, s2 = 0, s3 = 0, s4 = 0;
  std::array<double, 2> y0{}, y1{}, y2{};
  for (const SpeedSample& sample : window) {
    const double t = sample.t_s - origin, tt = t * t;
    s1 += t;
    s2 += tt;
    s3 += tt * t;
    s4 += tt * tt;
    for (std::size_t side : {0u, 1u}) {
      // Differences from the centre keep the sums small.
      const double w = sample.speed_rad_s[side] - window[at].speed_rad_s[side];
      y0[side] += w;
      y1[side] += w * t;
      y2[side] += w * tt;
    }
  }
  const double count = static_cast<double>(n);
  const bool two_sided = at > 0 && at + 1 < n;
  std::array<double, 2> slope{};
  if (!two_sided) {
    const double spread = count * s2 - s1 * s1;
    for (std::size_t side : {0u, 1u})
      slope[side] = spread > 0 ? (count * y1[side] - s1 * y0[side]) / spread : 0;
    return slope;
  }
  // Cramer's rule on the normal equations of a + b t + c t^2; only b, the slope at the centre, is wanted.
  const double determinant =
      count * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s3 * s2) + s2 * (s1 * s3 - s2 * s2);
  for (std::size_t side : {0u, 1u}) {
    const double numerator = count * (y1[side] * s4 - s3 * y2[side]) - y0[side] * (s1 * s4 - s3 * s2) +
                             s2 * (s1 * y2[side] - y1[side] * s2);
    slope[side] = numerator / determinant;
  }
  return slope;
}

}  // namespace joulecast::energy
