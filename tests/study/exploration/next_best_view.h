#pragma once

#include <optional>
#include <vector>

#include "tests/study/exploration/dist_bug.h"
#include "tests/study/exploration/node_grid.h"

namespace joulecast::exploration {

// One place that the robot might look from next.
struct Candidate {
  enum class Fate { kept, on_unseen, occupied, unreachable };

  Point position;
  std::size_t group = 0;      // the group of its circle
  bool moved_inside = false;  // the circle left the map here; moved straight back to its limit
  Fate fate = Fate::kept;
  std::size_t unseen_visible = 0;  // unseen nodes, of any group, that it would show; 0 when dropped
};

// The circle round one group of unseen nodes.
struct ViewCircle {
  Point center;         // mean of the group's nodes
  double radius_m = 0;  // to its farthest node
};

struct NextBestView {
  std::vector<ViewCircle> circles;
  std::vector<Candidate> candidates;
  // No candidate on a circle showed a new node, so that the seen nodes next to the groups were tried.
  bool from_frontier = false;
  std::size_t winner = 0;
  std::vector<Point> path;  // DistBug's, to the winner
};

// Thesis 5.3, after Connolly: candidates every 45 degrees on a circle round each group; moved inside the map
// when outside, dropped when unseen or occupied. The one showing most unseen nodes wins, the nearer one at a
// tie. Empty when no reachable place shows an unseen node.
std::optional<NextBestView> next_best_view(const Map& map, const NodeGrid& grid, const DistBug& bug,
                                           Point robot);

}  // namespace joulecast::exploration
