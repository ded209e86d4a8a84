#pragma once

#include <array>
#include <functional>
#include <optional>
#include <variant>
#include <vector>

#include "tests/study/exploration/map.h"
#include "tests/study/exploration/next_best_view.h"
#include "tests/study/exploration/node_grid.h"

namespace joulecast::exploration {

// The robot's motions, in order.
struct Turn {
  double angle_rad = 0;  // positive to the left
};
struct Straight {
  Point from, to;
  double length_m() const { return distance_m(from, to); }
};
using Motion = std::variant<Turn, Straight>;

// A look all round: four looks of 90 degrees, each followed by a quarter turn to the left, which ends at the
// heading it began with (thesis 5.1, "in four rotations").
struct Scan {
  Point at;
  double heading_rad = 0;
  std::array<std::size_t, 4> newly_seen{};
  std::size_t unseen_after = 0;
};

// A scan, and the next best view that it led to; the last round has none.
struct Round {
  Scan scan;
  std::optional<NextBestView> next;
};

enum class Outcome {
  explored,  // at most the map's stop_unseen_nodes stayed unseen
  stuck      // more stayed, but no place in reach shows any of them
};

struct Exploration {
  std::vector<Round> rounds;
  std::vector<Motion> motions;
  std::vector<NodeState> nodes;      // at the end, row by row from y = 0
  std::vector<std::size_t> seen_in;  // by node: the round that first saw it, counted from 1; 0 = none
  std::size_t columns = 0;
  std::size_t unseen = 0;
  Outcome outcome = Outcome::explored;

  double length_m() const;
  double turned_rad() const;  // sum of absolute angles
  // Corners of grown obstacles that the path goes round.
  std::size_t detours() const;
};

// Thesis chapter 5: scan, choose the next best view, go there by DistBug, until few enough nodes are unseen.
// Deterministic. Errors are the map's. `progress` is called after each scan with the number of seen nodes and
// of all nodes.
Result<Exploration> explore(const Map& map,
                            const std::function<void(std::size_t seen, std::size_t nodes)>& progress = {});

}  // namespace joulecast::exploration
