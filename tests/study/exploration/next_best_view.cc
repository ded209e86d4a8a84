#include "tests/study/exploration/next_best_view.h"

#include <algorithm>
#include <numbers>
#include <numeric>

namespace joulecast::exploration {
namespace {

constexpr int candidates_per_circle = 8;

ViewCircle circle_round(const NodeGrid& grid, const std::vector<std::size_t>& group) {
  ViewCircle circle;
  for (std::size_t n : group) circle.center = circle.center + grid.position(n);
  circle.center = (1 / static_cast<double>(group.size())) * circle.center;
  for (std::size_t n : group)
    circle.radius_m = std::max(circle.radius_m, distance_m(circle.center, grid.position(n)));
  return circle;
}

Candidate judged(const NodeGrid& grid, const DistBug& bug, Candidate candidate) {
  if (bug.inside_grown(candidate.position)) {
    candidate.fate = Candidate::Fate::occupied;
  } else if (grid.state(grid.nearest(candidate.position)) == NodeState::unseen) {
    candidate.fate = Candidate::Fate::on_unseen;
  } else {
    candidate.unseen_visible = grid.unseen_visible_from(candidate.position);
  }
  return candidate;
}

std::vector<Candidate> on_circle(const Map& map, const ViewCircle& circle, std::size_t group) {
  std::vector<Candidate> candidates;
  for (int k = 0; k < candidates_per_circle; ++k) {
    const double angle = 2 * std::numbers::pi * k / candidates_per_circle;
    const Point at = circle.center + circle.radius_m * Point{std::cos(angle), std::sin(angle)};
    const Point inside{std::clamp(at.x_m, 0.0, map.width_m), std::clamp(at.y_m, 0.0, map.height_m)};
    Candidate candidate;
    candidate.position = inside;
    candidate.group = group;
    candidate.moved_inside = inside != at;
    candidates.push_back(candidate);
  }
  return candidates;
}

// Seen nodes that touch a group.
std::vector<Candidate> beside(const NodeGrid& grid, const std::vector<std::size_t>& nodes,
                              std::size_t group) {
  std::vector<std::size_t> border;
  for (std::size_t n : nodes) {
    grid.for_each_neighbour(n, [&](std::size_t m) {
      if (grid.state(m) == NodeState::seen) border.push_back(m);
    });
  }
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());
  std::vector<Candidate> candidates;
  for (std::size_t n : border) {
    Candidate candidate;
    candidate.position = grid.position(n);
    candidate.group = group;
    candidates.push_back(candidate);
  }
  return candidates;
}

// The best of the candidates that a path leads to; those that none leads to are marked on the way.
bool choose(NextBestView& view, const DistBug& bug, Point robot) {
  std::vector<std::size_t> best_first(view.candidates.size());
  std::iota(best_first.begin(), best_first.end(), std::size_t{0});
  std::stable_sort(best_first.begin(), best_first.end(), [&](std::size_t a, std::size_t b) {
    const Candidate &p = view.candidates[a], &q = view.candidates[b];
    if (p.unseen_visible != q.unseen_visible) return p.unseen_visible > q.unseen_visible;
    return distance_m(robot, p.position) < distance_m(robot, q.position);
  });
  for (std::size_t k : best_first) {
    Candidate& candidate = view.candidates[k];
    if (candidate.unseen_visible == 0) return false;
    if (auto path = bug.path(robot, candidate.position)) {
      view.winner = k;
      view.path = std::move(*path);
      return true;
    }
    candidate.fate = Candidate::Fate::unreachable;
    candidate.unseen_visible = 0;
  }
  return false;
}

}  // namespace

std::optional<NextBestView> next_best_view(const Map& map, const NodeGrid& grid, const DistBug& bug,
                                           Point robot) {
  const auto groups = grid.unseen_groups();
  NextBestView view;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    view.circles.push_back(circle_round(grid, groups[g]));
    for (const Candidate& c : on_circle(map, view.circles.back(), g))
      view.candidates.push_back(judged(grid, bug, c));
  }
  if (choose(view, bug, robot)) return view;

  view.candidates.clear();
  view.from_frontier = true;
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const Candidate& c : beside(grid, groups[g], g)) view.candidates.push_back(judged(grid, bug, c));
  if (choose(view, bug, robot)) return view;
  return std::nullopt;
}

}  // namespace joulecast::exploration
