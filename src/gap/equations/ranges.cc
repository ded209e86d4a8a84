#include "gap/equations/ranges.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {

Ranges ranges_of(std::span<const Window> windows, double mean_power_w) {
  Ranges r{.mean_power_w = mean_power_w};
  for (const Window& w : windows) {
    for (const double speed : w.speed_rad_s) {
      if (!std::isfinite(speed)) continue;
      r.mean_wheel_speed_rad_s += 0.5 * std::fabs(speed) / static_cast<double>(windows.size());
    }
    r.payload_kg = std::max(r.payload_kg, w.payload_kg);
    r.position = r.position || std::isfinite(w.x_m + w.y_m);
    r.heading = r.heading || std::isfinite(w.heading_rad);
    r.climb = r.climb || std::fabs(w.climb_rad) > 0;
  }
  return r;
}

}  // namespace joulecast::gap
