#include "answers/floor_map.h"

#include <algorithm>
#include <cmath>

#include "statistics/distributions.h"

namespace joulecast::answers {
namespace {

constexpr double level = 0.05;

// The median over the mission's squares of measured over modelled energy, weighted by the latter; NaN where
// no square has both.
double usual_ratio(std::span<const history::FloorVisit> visits) {
  std::vector<std::pair<double, double>> ratios;  // with their weights
  double total = 0;
  for (const history::FloorVisit& v : visits) {
    if (!(v.modelled_j > 0)) continue;
    ratios.emplace_back(v.measured_j / v.modelled_j, v.modelled_j);
    total += v.modelled_j;
  }
  std::ranges::sort(ratios);
  double below = 0;
  for (const auto& [ratio, weight] : ratios)
    if ((below += weight) >= 0.5 * total) return ratio;
  return signals::unmeasured;
}

}  // namespace

double FloorCell::energy_per_distance_j_m(double cell_m) const {
  // A robot that crosses the square drives its width; less than half of the width is no crossing.
  return distance_m >= 0.5 * cell_m ? driving_j / distance_m : signals::unmeasured;
}

void FloorMapper::Departure::add(double excess, double expected) {
  ++missions;
  excess_j += excess;
  expected_j += expected;
  excess2 += excess * excess;
  product += excess * expected;
  expected2 += expected * expected;
}

bool FloorMapper::add(const history::FloorMission& mission) {
  const double usual = usual_ratio(mission.visits);
  const std::size_t robot = robots_.try_emplace(std::string(mission.robot_id), robots_.size()).first->second;
  for (const history::FloorVisit& v : mission.visits) {
    Square& square = squares_[{v.column, v.row}];
    FloorCell& cell = square.cell;
    ++cell.missions;
    cell += v;
    square.robots.insert(robot);
    if (usual > 0 && v.modelled_j != 0)
      square.departure.add(v.measured_j - usual * v.modelled_j, usual * v.modelled_j);
  }
  return squares_.size() <= most_floor_cells;
}

void FloorMapper::judge(std::vector<std::pair<Place, const Departure*>>& of,
                        std::map<Place, FloorCell>& cells) {
  std::erase_if(of, [](const auto& each) {
    return each.second->missions < least_floor_missions || !(each.second->expected_j > 0);
  });
  for (const auto& [place, d] : of) {
    FloorCell& cell = cells.at(place);
    const auto n = static_cast<double>(d->missions);
    cell.departure = d->excess_j / d->expected_j;
    const double residual2 =
        d->excess2 - 2 * cell.departure * d->product + cell.departure * cell.departure * d->expected2;
    const double error = std::sqrt(std::max(0.0, residual2) * n / (n - 1)) / d->expected_j;
    const double half = statistics::student_t_quantile(1 - level / 2, n - 1) * error;
    cell.interval = {cell.departure - half, cell.departure + half};
    // By Bonferroni, for there are many squares.
    const double sure =
        statistics::student_t_quantile(1 - level / (2 * static_cast<double>(of.size())), n - 1) * error;
    cell.stands_out = std::fabs(cell.departure) >= std::max(least_floor_departure, sure);
  }
}

std::vector<FloorZone> FloorMapper::zones(const std::map<Place, FloorCell>& cells) const {
  std::vector<FloorZone> found;
  std::set<Place> seen;
  for (const auto& [first, start] : cells) {
    if (!start.stands_out || !seen.insert(first).second) continue;
    FloorZone zone{start.x_m, start.y_m, start.x_m, start.y_m};
    double expected_j = 0;
    std::vector<Place> open{first};
    while (!open.empty()) {
      const Place at = open.back();
      open.pop_back();
      const FloorCell& cell = cells.at(at);
      const Departure& departure = squares_.at(at).departure;
      ++zone.cells;
      zone.x_min_m = std::min(zone.x_min_m, cell.x_m);
      zone.y_min_m = std::min(zone.y_min_m, cell.y_m);
      zone.x_max_m = std::max(zone.x_max_m, cell.x_m + cell_m_);
      zone.y_max_m = std::max(zone.y_max_m, cell.y_m + cell_m_);
      zone.covered_s += cell.covered_s;
      zone.distance_m += cell.distance_m;
      zone.excess_j += departure.excess_j;
      expected_j += departure.expected_j;
      for (std::int32_t dx = -1; dx <= 1; ++dx)
        for (std::int32_t dy = -1; dy <= 1; ++dy) {
          const Place next{at.first + dx, at.second + dy};
          const auto there = cells.find(next);
          if (there == cells.end() || !there->second.stands_out) continue;
          if ((there->second.departure > 0) == (start.departure > 0) && seen.insert(next).second)
            open.push_back(next);
        }
    }
    zone.departure = zone.excess_j / expected_j;
    found.push_back(zone);
  }
  std::ranges::sort(found, std::ranges::greater{}, [](const FloorZone& z) { return std::fabs(z.excess_j); });
  return found;
}

Result<FloorMap> FloorMapper::finish(const history::FloorReading& reading) const {
  if (squares_.size() > most_floor_cells)
    return invalid("cell_m", "gives more than " + std::to_string(most_floor_cells) +
                                 " squares: choose greater ones, a shorter time or fewer robots");
  FloorMap map;
  map.cell_m = cell_m_;
  map.reading = reading;
  for (const auto& [id, number] : robots_) map.robots.push_back(id);
  std::map<Place, FloorCell> cells;
  std::vector<std::pair<Place, const Departure*>> departures;
  for (const auto& [place, square] : squares_) {
    FloorCell cell = square.cell;
    cell.x_m = place.first * cell_m_;
    cell.y_m = place.second * cell_m_;
    cell.robots = static_cast<std::int64_t>(square.robots.size());
    map += cell;
    departures.emplace_back(place, &square.departure);
    cells.emplace_hint(cells.end(), place, cell);
  }
  judge(departures, cells);
  map.zones = zones(cells);
  for (const auto& [place, cell] : cells) map.cells.push_back(cell);
  std::ranges::stable_sort(map.cells, std::ranges::greater{}, &FloorCell::covered_s);
  return map;
}

}  // namespace joulecast::answers
