#include <algorithm>
#include <array>
#include <cmath>

#include "gap/posterior/catalogue.h"
#include "statistics/robust.h"

namespace joulecast::gap::posterior {

std::vector<Zone> find_zones(const Data& d, const Eigen::VectorXd& residual_w, std::size_t most) {
  constexpr std::size_t side = 9;
  constexpr std::array radii{0.15, 0.22, 0.3};  // of the floor's extent
  constexpr std::size_t fewest = 20;
  constexpr double most_share = 0.6, apart = 0.1;
  constexpr auto moves = std::to_array<std::array<double, 3>>(
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}});
  const std::size_t n = d.rows.size();
  const double r = d.robot.kinematics.wheel_radius_m;
  Eigen::VectorXd x(ix(n)), y(ix(n)), travel(ix(n));
  for (std::size_t k = 0; k < n; ++k) {
    const Window& w = d.rows.window(k);
    const bool known = std::isfinite(w.x_m + w.y_m);
    x[ix(k)] = known ? w.x_m : 0;
    y[ix(k)] = known ? w.y_m : 0;
    travel[ix(k)] = known ? std::fabs(w.speed_rad_s[0] + w.speed_rad_s[1]) * r / 2 : 0;
  }
  Eigen::MatrixXd plain(ix(n), 3);
  plain << travel, Eigen::VectorXd::Ones(ix(n)), travel.cwiseAbs2();
  const Eigen::VectorXd left = residual_w - plain * plain.colPivHouseholderQr().solve(residual_w);
  const auto range = [](const Eigen::VectorXd& v) {
    const std::vector<double> all(v.begin(), v.end());
    return std::array{statistics::quantile(all, 0.02), statistics::quantile(all, 0.98)};
  };
  const auto in_x = range(x), in_y = range(y);
  const double extent = std::max({in_x[1] - in_x[0], in_y[1] - in_y[0], 0.5});
  // Score of friction within a disc, beyond that of all motion, as an explanation of the residual; 0: too few
  // rows.
  const auto score_of = [&](const Zone& zone) {
    const Eigen::ArrayXd distance =
        ((x.array() - zone.x_m).square() + (y.array() - zone.y_m).square()).sqrt();
    Eigen::VectorXd z = (distance < zone.radius_m).select(travel, 0.0);
    const auto count = static_cast<std::size_t>((z.array() > 0).count());
    if (count < fewest || static_cast<double>(count) > most_share * static_cast<double>(n)) return 0.0;
    z -= travel * (z.dot(travel) / std::max(travel.squaredNorm(), 1e-9));
    const double g = z.dot(left);
    return g * std::fabs(g) / std::max(z.squaredNorm(), 1e-9);
  };
  std::vector<std::pair<double, Zone>> found;
  for (std::size_t i = 0; i < side * side; ++i) {
    const double cx = std::lerp(in_x[0], in_x[1], static_cast<double>(i / side) / (side - 1.0));
    const double cy = std::lerp(in_y[0], in_y[1], static_cast<double>(i % side) / (side - 1.0));
    for (const double part : radii) {
      const Zone zone{cx, cy, part * extent};
      if (const double s = score_of(zone); s != 0) found.push_back({s, zone});
    }
  }
  std::ranges::stable_sort(found, std::greater(), &std::pair<double, Zone>::first);
  std::vector<Zone> zones;
  for (const auto& [score, zone] : found) {
    const bool near = std::ranges::any_of(zones, [&](const Zone& z) {
      return std::hypot(z.x_m - zone.x_m, z.y_m - zone.y_m) <= apart * extent &&
             std::fabs(z.radius_m - zone.radius_m) <= apart * extent;
    });
    if (!near) zones.push_back(zone);
    if (zones.size() == most) break;
  }
  // Moves to a better place and radius nearby, by half of the grid, a quarter and an eighth.
  for (Zone& zone : zones) {
    double most_score = score_of(zone);
    for (double step = extent / (2 * (side - 1.0)); step > extent / (10 * (side - 1.0)); step /= 2) {
      for (bool better = true; better;) {
        better = false;
        for (const auto& [dx, dy, dr] : moves) {
          const Zone moved{zone.x_m + dx * step, zone.y_m + dy * step, zone.radius_m + dr * step};
          const double s = score_of(moved);
          if (!(s > most_score)) continue;
          most_score = s;
          zone = moved;
          better = true;
        }
      }
    }
  }
  return zones;
}

}  // namespace joulecast::gap::posterior
