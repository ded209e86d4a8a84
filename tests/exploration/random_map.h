#pragma once

#include <numbers>
#include <random>
#include <vector>

#include "tests/study/exploration/map.h"

namespace joulecast::exploration {

// A convex polygon of 3 to 8 corners on a circle.
inline ConvexPolygon random_polygon(std::mt19937_64& random, Point center, double radius_m) {
  std::uniform_real_distribution<double> share(0.25, 1);
  std::uniform_int_distribution<int> count(3, 8);
  std::vector<double> gaps(static_cast<std::size_t>(count(random)));
  double sum = 0;
  for (double& gap : gaps) sum += gap = share(random);
  std::vector<Point> corners;
  double angle = 2 * std::numbers::pi * share(random);
  for (const double gap : gaps) {
    corners.push_back(center + radius_m * Point{std::cos(angle), std::sin(angle)});
    angle += 2 * std::numbers::pi * gap / sum;
  }
  return *ConvexPolygon::from_corners(corners);
}

// 20 m x 20 m with up to 5 obstacles and a start outside all grown ones.
inline Map random_map(std::mt19937_64& random) {
  std::uniform_real_distribution<double> along(1, 19), radius(0.5, 3);
  std::uniform_int_distribution<int> count(0, 5);
  for (;;) {
    Map map;
    map.node_spacing_m = 0.5;
    map.safety_radius_m = 0.6;
    for (int k = count(random); k > 0; --k) {
      const double x = along(random), y = along(random);
      map.obstacles.push_back(random_polygon(random, {x, y}, radius(random)));
    }
    map.start = {along(random), along(random)};
    map.start_heading_rad = along(random);
    if (validate(map)) return map;
  }
}

}  // namespace joulecast::exploration
