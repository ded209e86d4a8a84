#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tests/study/exploration/map.h"

namespace joulecast::exploration {

enum class NodeState : std::uint8_t { unseen, seen, occupied };

// The robot's map of the ground: nodes at multiples of the spacing, thesis 5.2. Nodes within a grown
// obstacle are occupied: the robot's middle can never stand there. Only the obstacles themselves hide nodes.
class NodeGrid {
 public:
  explicit NodeGrid(const Map& map);

  std::size_t size() const { return states_.size(); }
  std::size_t columns() const { return columns_; }
  std::size_t rows() const { return rows_; }
  Point position(std::size_t node) const;
  NodeState state(std::size_t node) const { return states_[node]; }
  std::span<const NodeState> states() const { return states_; }
  std::size_t count(NodeState state) const;
  std::size_t nearest(Point p) const;

  // Whether the straight line from `eye` to `target` lies outside every obstacle.
  bool visible(Point eye, Point target) const;

  // Unseen nodes that a view all round from `eye` would show.
  std::size_t unseen_visible_from(Point eye) const;

  // Looks with a field of view of 90 degrees about `heading_rad` and marks the visible nodes; returns how
  // many nodes are new.
  std::size_t look(Point eye, double heading_rad);

  // Unseen nodes in groups that hang together, diagonals included; each ascending, groups by first node.
  std::vector<std::vector<std::size_t>> unseen_groups() const;

  // Calls `visit` for the up to 8 nodes around one.
  template <class Visit>
  void for_each_neighbour(std::size_t node, Visit&& visit) const {
    const std::size_t column = node % columns_, row = node / columns_;
    for (std::size_t r = row > 0 ? row - 1 : 0; r <= row + 1 && r < rows_; ++r)
      for (std::size_t c = column > 0 ? column - 1 : 0; c <= column + 1 && c < columns_; ++c)
        if (r != row || c != column) visit(r * columns_ + c);
  }

 private:
  std::vector<ConvexPolygon> obstacles_;
  double spacing_m_;
  std::size_t columns_, rows_;
  std::vector<NodeState> states_;
};

}  // namespace joulecast::exploration
