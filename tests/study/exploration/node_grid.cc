#include "tests/study/exploration/node_grid.h"

#include <algorithm>

namespace joulecast::exploration {
namespace {

// A side that is a whole number of spacings keeps its last node in spite of rounding.
std::size_t nodes_along(double side_m, double spacing_m) {
  return static_cast<std::size_t>(std::floor(side_m / spacing_m + 1e-9)) + 1;
}

}  // namespace

NodeGrid::NodeGrid(const Map& map)
    : obstacles_(map.obstacles),
      spacing_m_(map.node_spacing_m),
      columns_(nodes_along(map.width_m, map.node_spacing_m)),
      rows_(nodes_along(map.height_m, map.node_spacing_m)),
      states_(columns_ * rows_, NodeState::unseen) {
  for (const ConvexPolygon& obstacle : obstacles_) {
    const ConvexPolygon grown = obstacle.grown(map.safety_radius_m);
    for (std::size_t n = 0; n < states_.size(); ++n)
      if (grown.contains(position(n))) states_[n] = NodeState::occupied;
  }
}

Point NodeGrid::position(std::size_t node) const {
  return {static_cast<double>(node % columns_) * spacing_m_,
          static_cast<double>(node / columns_) * spacing_m_};
}

std::size_t NodeGrid::count(NodeState state) const {
  return static_cast<std::size_t>(std::count(states_.begin(), states_.end(), state));
}

std::size_t NodeGrid::nearest(Point p) const {
  const auto index = [&](double coordinate, std::size_t nodes) {
    const double k = std::round(coordinate / spacing_m_);
    return static_cast<std::size_t>(std::clamp(k, 0.0, static_cast<double>(nodes - 1)));
  };
  return index(p.y_m, rows_) * columns_ + index(p.x_m, columns_);
}

bool NodeGrid::visible(Point eye, Point target) const {
  return std::none_of(obstacles_.begin(), obstacles_.end(),
                      [&](const ConvexPolygon& o) { return o.blocks(eye, target); });
}

std::size_t NodeGrid::unseen_visible_from(Point eye) const {
  std::size_t total = 0;
  for (std::size_t n = 0; n < states_.size(); ++n)
    if (states_[n] == NodeState::unseen && visible(eye, position(n))) ++total;
  return total;
}

std::size_t NodeGrid::look(Point eye, double heading_rad) {
  const Point ahead{std::cos(heading_rad), std::sin(heading_rad)};
  std::size_t fresh = 0;
  for (std::size_t n = 0; n < states_.size(); ++n) {
    if (states_[n] != NodeState::unseen) continue;
    const Point offset = position(n) - eye;
    // Within 45 degrees of ahead; rounding must not lose the nodes between two looks.
    if (dot(ahead, offset) + contact_m < std::fabs(cross(ahead, offset))) continue;
    if (!visible(eye, position(n))) continue;
    states_[n] = NodeState::seen;
    ++fresh;
  }
  return fresh;
}

std::vector<std::vector<std::size_t>> NodeGrid::unseen_groups() const {
  std::vector<std::vector<std::size_t>> groups;
  std::vector<bool> taken(states_.size(), false);
  for (std::size_t first = 0; first < states_.size(); ++first) {
    if (states_[first] != NodeState::unseen || taken[first]) continue;
    std::vector<std::size_t> group{first};
    taken[first] = true;
    for (std::size_t k = 0; k < group.size(); ++k) {
      for_each_neighbour(group[k], [&](std::size_t n) {
        if (states_[n] != NodeState::unseen || taken[n]) return;
        taken[n] = true;
        group.push_back(n);
      });
    }
    std::sort(group.begin(), group.end());
    groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace joulecast::exploration
