#include "tests/study/exploration/dist_bug.h"

#include <algorithm>
#include <numeric>

namespace joulecast::exploration {

DistBug::DistBug(const Map& map) {
  for (const ConvexPolygon& obstacle : map.obstacles) grown_.push_back(obstacle.grown(map.safety_radius_m));
  for (const ConvexPolygon& polygon : grown_) {
    for (const Point& c : polygon.corners()) {
      const bool on_map = c.x_m >= 0 && c.x_m <= map.width_m && c.y_m >= 0 && c.y_m <= map.height_m;
      if (on_map && !inside_grown(c)) corners_.push_back(c);
    }
  }
}

bool DistBug::inside_grown(Point p) const {
  return std::any_of(grown_.begin(), grown_.end(), [&](const ConvexPolygon& g) { return g.contains(p); });
}

bool DistBug::free(Point from, Point to) const {
  return std::none_of(grown_.begin(), grown_.end(),
                      [&](const ConvexPolygon& g) { return g.blocks(from, to); });
}

std::optional<std::vector<Point>> DistBug::path(Point from, Point goal) const {
  std::vector<std::size_t> nearest_first(corners_.size());
  std::iota(nearest_first.begin(), nearest_first.end(), std::size_t{0});
  std::stable_sort(nearest_first.begin(), nearest_first.end(), [&](std::size_t a, std::size_t b) {
    return distance_m(corners_[a], goal) < distance_m(corners_[b], goal);
  });
  std::vector<bool> passed(corners_.size(), false);
  std::vector<Point> way;
  for (;;) {
    const Point here = way.empty() ? from : way.back();
    if (free(here, goal)) {
      way.push_back(goal);
      return way;
    }
    const auto next = std::find_if(nearest_first.begin(), nearest_first.end(), [&](std::size_t k) {
      return !passed[k] && corners_[k] != here && free(here, corners_[k]);
    });
    if (next != nearest_first.end()) {
      passed[*next] = true;
      way.push_back(corners_[*next]);
    } else if (!way.empty()) {
      way.pop_back();
    } else {
      return std::nullopt;
    }
  }
}

}  // namespace joulecast::exploration
