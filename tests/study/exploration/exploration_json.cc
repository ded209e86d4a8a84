#include "tests/study/exploration/exploration_json.h"

#include <nlohmann/json.hpp>

#include "tests/study/exploration/map_file.h"

namespace joulecast::exploration {
namespace {

using Json = nlohmann::json;

Json pair(Point p) {
  return Json::array({p.x_m, p.y_m});
}

const char* name_of(Candidate::Fate fate) {
  switch (fate) {
    case Candidate::Fate::kept:
      return "kept";
    case Candidate::Fate::on_unseen:
      return "on_unseen";
    case Candidate::Fate::occupied:
      return "occupied";
    case Candidate::Fate::unreachable:
      break;
  }
  return "unreachable";
}

Json view_json(const NextBestView& view) {
  Json circles = Json::array(), candidates = Json::array(), path = Json::array();
  for (const ViewCircle& c : view.circles)
    circles.push_back({{"center_m", pair(c.center)}, {"radius_m", c.radius_m}});
  for (const Candidate& c : view.candidates) {
    candidates.push_back(
        {{"position_m", pair(c.position)},
         {"group", c.group},
         {"moved_inside", c.moved_inside},
         {"fate", name_of(c.fate)},
         {"unseen_visible", c.fate == Candidate::Fate::kept ? Json(c.unseen_visible) : Json()}});
  }
  for (const Point& p : view.path) path.push_back(pair(p));
  return {{"circles", circles},
          {"candidates", candidates},
          {"from_frontier", view.from_frontier},
          {"winner", view.winner},
          {"path_m", path}};
}

Json motion_json(const Motion& motion) {
  if (const auto* turn = std::get_if<Turn>(&motion)) return {{"turn_rad", turn->angle_rad}};
  const auto& straight = std::get<Straight>(motion);
  return {{"from_m", pair(straight.from)}, {"to_m", pair(straight.to)}, {"length_m", straight.length_m()}};
}

Json spent_json(const Spent& spent) {
  return {{"energy_j", spent.energy_j},
          {"duration_s", spent.duration_s},
          {"peak_speed_m_s", spent.peak_speed_m_s}};
}

Json energy_json(const MissionEnergy& e) {
  return {{"payload_kg", e.payload_kg},
          {"turn_rate_rad_s", e.turn_rate_rad_s},
          {"turns", {{"energy_j", e.turns.energy_j}, {"duration_s", e.turns.duration_s}}},
          {"triangle", spent_json(e.triangle)},
          {"optimal", spent_json(e.optimal)},
          {"triangle_total_j", e.triangle_total_j()},
          {"optimal_total_j", e.optimal_total_j()},
          {"saving", e.saving()}};
}

}  // namespace

Json to_json(const Map& map, const Exploration& exploration, std::span<const MissionEnergy> energy) {
  Json rounds = Json::array(), motions = Json::array(), energies = Json::array();
  for (const Round& round : exploration.rounds) {
    rounds.push_back({{"scan",
                       {{"position_m", pair(round.scan.at)},
                        {"heading_rad", round.scan.heading_rad},
                        {"newly_seen", round.scan.newly_seen},
                        {"unseen_after", round.scan.unseen_after}}},
                      {"next_best_view", round.next ? view_json(*round.next) : Json()}});
  }
  for (const Motion& motion : exploration.motions) motions.push_back(motion_json(motion));
  for (const MissionEnergy& e : energy) energies.push_back(energy_json(e));
  return {{"map", map_to_json(map)},
          {"outcome", exploration.outcome == Outcome::explored ? "explored" : "stuck"},
          {"nodes", exploration.nodes.size()},
          {"unseen_nodes", exploration.unseen},
          {"length_m", exploration.length_m()},
          {"turned_rad", exploration.turned_rad()},
          {"corners_rounded", exploration.detours()},
          {"rounds", rounds},
          {"motions", motions},
          {"energy", energies}};
}

}  // namespace joulecast::exploration
