#include "tests/study/exploration/explore.h"

#include <numbers>

namespace joulecast::exploration {
namespace {

constexpr double quarter_turn_rad = std::numbers::pi / 2;
constexpr double no_turn_rad = 1e-9;

Scan scan_round(NodeGrid& grid, Point at, double heading_rad, std::vector<Motion>& motions) {
  Scan scan;
  scan.at = at;
  scan.heading_rad = heading_rad;
  for (std::size_t k = 0; k < scan.newly_seen.size(); ++k) {
    scan.newly_seen[k] = grid.look(at, heading_rad + static_cast<double>(k) * quarter_turn_rad);
    motions.emplace_back(Turn{quarter_turn_rad});
  }
  scan.unseen_after = grid.count(NodeState::unseen);
  return scan;
}

}  // namespace

double Exploration::length_m() const {
  double sum = 0;
  for (const Motion& motion : motions)
    if (const auto* straight = std::get_if<Straight>(&motion)) sum += straight->length_m();
  return sum;
}

double Exploration::turned_rad() const {
  double sum = 0;
  for (const Motion& motion : motions)
    if (const auto* turn = std::get_if<Turn>(&motion)) sum += std::fabs(turn->angle_rad);
  return sum;
}

std::size_t Exploration::detours() const {
  std::size_t corners = 0;
  for (const Round& round : rounds)
    if (round.next) corners += round.next->path.size() - 1;
  return corners;
}

Result<Exploration> explore(const Map& map,
                            const std::function<void(std::size_t seen, std::size_t nodes)>& progress) {
  if (auto ok = validate(map); !ok) return tl::unexpected(ok.error());
  NodeGrid grid(map);
  const DistBug bug(map);
  Exploration result;
  result.columns = grid.columns();
  result.seen_in.assign(grid.size(), 0);
  Point at = map.start;
  double heading = wrapped(map.start_heading_rad);
  for (;;) {
    Round round{scan_round(grid, at, heading, result.motions), std::nullopt};
    for (std::size_t n = 0; n < grid.size(); ++n)
      if (grid.state(n) == NodeState::seen && result.seen_in[n] == 0)
        result.seen_in[n] = result.rounds.size() + 1;
    const std::size_t unseen = round.scan.unseen_after;
    if (progress) progress(grid.size() - unseen, grid.size());
    if (unseen > map.stop_unseen_nodes) round.next = next_best_view(map, grid, bug, at);
    if (round.next) {
      for (const Point& next : round.next->path) {
        if (distance_m(at, next) <= contact_m) continue;
        const double course = heading_rad(at, next), turn = wrapped(course - heading);
        if (std::fabs(turn) > no_turn_rad) result.motions.emplace_back(Turn{turn});
        result.motions.emplace_back(Straight{at, next});
        at = next;
        heading = course;
      }
    }
    const bool on_the_way = round.next.has_value();
    result.rounds.push_back(std::move(round));
    if (on_the_way) continue;
    result.unseen = unseen;
    result.outcome = unseen <= map.stop_unseen_nodes ? Outcome::explored : Outcome::stuck;
    result.nodes.assign(grid.states().begin(), grid.states().end());
    return result;
  }
}

}  // namespace joulecast::exploration
