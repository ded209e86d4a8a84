#include "planning/cost_matrix.h"

#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <unordered_map>
#include <utility>

namespace joulecast::planning {
namespace {

// Stations closer than this are one place, towards which nobody turns.
constexpr double same_place_m = 1e-6;

LegCost cost_of(const CostTable& table, std::span<const double> distances_m,
                std::span<const double> turns_rad, double payload_kg) {
  LegCost sum;
  for (const double d : distances_m) sum += table.straight(d, payload_kg);
  for (const double a : turns_rad) sum += table.turn(a, payload_kg);
  return sum;
}

double angle_between(double from, double to) {
  return std::remainder(to - from, 2 * std::numbers::pi);
}

// Turn towards the place, drive there, turn to its heading.
LegCost between(const CostTable& table, const Pose& from, const Station& to, double payload_kg) {
  const double dx = to.x_m - from.x_m, dy = to.y_m - from.y_m, distance = std::hypot(dx, dy);
  double heading = from.heading_rad;
  LegCost sum;
  if (distance > same_place_m) {
    const double way = std::atan2(dy, dx);
    sum += table.turn(angle_between(heading, way), payload_kg);
    sum += table.straight(distance, payload_kg);
    heading = way;
  }
  if (to.heading_rad) sum += table.turn(angle_between(heading, *to.heading_rad), payload_kg);
  return sum;
}

}  // namespace

std::string_view name_of(Obstacle obstacle) {
  switch (obstacle) {
    case Obstacle::none:
      return "none";
    case Obstacle::payload:
      return "payload";
    case Obstacle::limits:
      return "limits";
    case Obstacle::pose:
      return "pose";
    case Obstacle::model:
      return "model";
  }
  return "";
}

CostMatrix::CostMatrix(std::vector<MatrixRobot> robots, std::vector<MatrixTask> tasks)
    : robots_(std::move(robots)), tasks_(std::move(tasks)) {
  std::unordered_map<const CostTable*, std::size_t> places;
  for (const MatrixRobot& robot : robots_) {
    if (robot.table == nullptr) {
      table_of_.push_back(0);
      continue;
    }
    const auto [place, fresh] = places.try_emplace(robot.table.get(), loaded_.size());
    if (fresh) loaded_.push_back(std::make_unique<Loaded>());
    table_of_.push_back(place->second);
  }
}

const std::vector<LegCost>& CostMatrix::loaded_legs(std::size_t table, const CostTable& costs) const {
  Loaded& loaded = *loaded_[table];
  std::call_once(loaded.once, [&] {
    loaded.legs.reserve(tasks_.size());
    for (const MatrixTask& task : tasks_) {
      if (task.loaded) {
        loaded.legs.push_back(
            cost_of(costs, task.loaded->distances_m, task.loaded->turns_rad, task.payload_kg));
        continue;
      }
      // With no heading at the pick-up the robot stands as it came; its turn is then part of the cell.
      const Station& from = *task.pickup;
      const double way = std::atan2(task.dropoff->y_m - from.y_m, task.dropoff->x_m - from.x_m);
      loaded.legs.push_back(between(costs, {from.x_m, from.y_m, from.heading_rad.value_or(way)},
                                    *task.dropoff, task.payload_kg));
    }
  });
  return loaded.legs;
}

void CostMatrix::row(std::size_t r, std::vector<Cell>& cells) const {
  const MatrixRobot& robot = robots_[r];
  cells.assign(tasks_.size(), Cell{});
  if (robot.table == nullptr) {
    for (Cell& cell : cells) cell.obstacle = Obstacle::model;
    return;
  }
  const CostTable& costs = *robot.table;
  const std::vector<LegCost>& loaded = loaded_legs(table_of_[r], costs);
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const MatrixTask& task = tasks_[t];
    Cell& cell = cells[t];
    if (task.payload_kg > robot.payload_limit_kg) {
      cell.obstacle = Obstacle::payload;
      continue;
    }
    if (task.empty.empty() && !robot.pose) {
      cell.obstacle = Obstacle::pose;
      continue;
    }
    LegCost sum = loaded[t];
    if (!task.empty.empty()) {
      const Leg& leg = task.empty.size() == 1 ? task.empty[0] : task.empty[r];
      sum += cost_of(costs, leg.distances_m, leg.turns_rad, 0);
    } else {
      sum += between(costs, *robot.pose, *task.pickup, 0);
      if (!task.loaded && !task.pickup->heading_rad) {
        const Station &from = *task.pickup, &to = *task.dropoff;
        const double dx = from.x_m - robot.pose->x_m, dy = from.y_m - robot.pose->y_m;
        const double arrived =
            std::hypot(dx, dy) > same_place_m ? std::atan2(dy, dx) : robot.pose->heading_rad;
        if (std::hypot(to.x_m - from.x_m, to.y_m - from.y_m) > same_place_m) {
          const double way = std::atan2(to.y_m - from.y_m, to.x_m - from.x_m);
          sum += costs.turn(angle_between(arrived, way), task.payload_kg);
        }
      }
    }
    const double dwell = task.pickup_dwell_s + task.dropoff_dwell_s;
    sum += {costs.idle_power_w() * dwell, dwell};
    if (std::isfinite(sum.energy_j)) {
      cell.energy_j = sum.energy_j;
      cell.duration_s = sum.duration_s;
      cell.loaded = loaded[t];
    } else {
      cell.obstacle = Obstacle::limits;
    }
  }
}

}  // namespace joulecast::planning
