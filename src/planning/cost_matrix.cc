#include "planning/cost_matrix.h"

#include <array>
#include <cmath>
#include <numbers>
#include <unordered_map>
#include <utility>

namespace joulecast::planning {
namespace {

double angle_between(double from, double to) {
  return std::remainder(to - from, 2 * std::numbers::pi);
}

PlannedLeg straight_leg(double distance_m) {
  return {Motion::drive, distance_m};
}
PlannedLeg turn_leg(double angle_rad) {
  return {Motion::turn, std::fabs(angle_rad)};
}
PlannedLeg dwell_leg(double duration_s) {
  return {.duration_s = duration_s};
}

// The segments of a way go to `drive`, in order.
template <class Drive>
void drive_leg(const Leg& leg, Drive& drive) {
  for (const PlannedLeg& each : leg) drive(each);
}

// Turn towards the place, drive there, turn to its heading.
template <class Drive>
void drive_between(const Pose& from, const Station& to, Drive& drive) {
  const double dx = to.x_m - from.x_m, dy = to.y_m - from.y_m, distance = std::hypot(dx, dy);
  double heading = from.heading_rad;
  if (distance > same_place_m) {
    const double way = std::atan2(dy, dx);
    drive(turn_leg(angle_between(heading, way)));
    drive(straight_leg(distance));
    heading = way;
  }
  if (to.heading_rad) drive(turn_leg(angle_between(heading, *to.heading_rad)));
}

template <class Drive>
void drive_loaded(const MatrixTask& task, Drive& drive) {
  if (task.loaded) return drive_leg(*task.loaded, drive);
  // Without a heading at the pick-up the robot keeps its direction of arrival; see turn_at_pickup().
  const Station &from = *task.stations.pickup, &to = *task.stations.dropoff;
  const double way = std::atan2(to.y_m - from.y_m, to.x_m - from.x_m);
  drive_between({from.x_m, from.y_m, from.heading_rad.value_or(way)}, to, drive);
}

template <class Drive>
void drive_empty(const MatrixTask& task, std::size_t robot, const std::optional<Pose>& pose, Drive& drive) {
  if (task.empty.empty()) return drive_between(*pose, *task.stations.pickup, drive);
  drive_leg(task.empty.size() == 1 ? task.empty[0] : task.empty[robot], drive);
}

// From the heading in which the robot came to a pick-up that has none, towards the drop-off.
template <class Drive>
void turn_at_pickup(const MatrixTask& task, const std::optional<Pose>& pose, Drive& drive) {
  if (!task.empty.empty() || task.loaded || task.stations.pickup->heading_rad) return;
  const Station &from = *task.stations.pickup, &to = *task.stations.dropoff;
  if (!(std::hypot(to.x_m - from.x_m, to.y_m - from.y_m) > same_place_m)) return;
  const double dx = from.x_m - pose->x_m, dy = from.y_m - pose->y_m;
  const double arrived = std::hypot(dx, dy) > same_place_m ? std::atan2(dy, dx) : pose->heading_rad;
  drive(turn_leg(angle_between(arrived, std::atan2(to.y_m - from.y_m, to.x_m - from.x_m))));
}

// Sums the costs in a table.
struct Pricer {
  const CostTable& table;
  double payload_kg = 0;
  std::stop_token stop = {};
  LegCost sum = {};
  void operator()(const PlannedLeg& leg) {
    if (leg.motion == Motion::stand)
      sum += {table.idle_power_w() * leg.duration_s, leg.duration_s};
    else if (leg.run)
      sum += table.solved(*leg.run, payload_kg, stop);
    else
      sum +=
          leg.motion == Motion::turn ? table.turn(leg.way, payload_kg) : table.straight(leg.way, payload_kg);
  }
};

}  // namespace

std::string_view name_of(Obstacle obstacle) {
  constexpr std::array<std::string_view, 5> names = {"none", "payload", "limits", "pose", "model"};
  static_assert(static_cast<Obstacle>(names.size() - 1) == Obstacle::model);
  return names[static_cast<std::size_t>(obstacle)];
}

Leg leg_of(const Path& path) {
  Leg straights, turns, others, dwells;
  for (const Run& run : path.runs) {
    dwells.push_back(dwell_leg(run.dwell_before_s));
    if (run.turn != 0 && run.length() <= widest_turn_rad)
      turns.push_back(turn_leg(run.length()));
    else if (run.turn == 0 && run.straight() && run.length() <= longest_leg_m)
      straights.push_back(straight_leg(run.length()));
    else
      others.push_back(planned_leg(std::make_shared<const Run>(run)));
  }
  dwells.push_back(dwell_leg(path.dwell_after_s));
  for (const Leg* more : {&turns, &others, &dwells})
    straights.insert(straights.end(), more->begin(), more->end());
  return straights;
}

Obstacle obstacle_of(const MatrixTask& task, double payload_limit_kg, bool pose_known) {
  if (task.payload_kg > payload_limit_kg) return Obstacle::payload;
  return task.empty.empty() && !pose_known ? Obstacle::pose : Obstacle::none;
}

std::vector<PlannedLeg> legs_of(const MatrixTask& task, std::size_t robot, const std::optional<Pose>& pose) {
  std::vector<PlannedLeg> legs;
  double payload_kg = 0;
  const auto add = [&](PlannedLeg leg) {
    leg.payload_kg = payload_kg;
    if (leg.way > 0 || leg.duration_s > 0) legs.push_back(std::move(leg));
  };
  drive_empty(task, robot, pose, add);
  add(dwell_leg(task.stations.pickup_dwell_s.value_or(0)));
  payload_kg = task.payload_kg;
  turn_at_pickup(task, pose, add);
  drive_loaded(task, add);
  add(dwell_leg(task.stations.dropoff_dwell_s.value_or(0)));
  return legs;
}

CostMatrix::CostMatrix(std::vector<MatrixRobot> robots, std::vector<MatrixTask> tasks)
    : robots_(std::move(robots)), tasks_(std::move(tasks)) {
  std::unordered_map<const CostTable*, std::size_t> places;
  for (const MatrixRobot& robot : robots_) {
    if (robot.table == nullptr) {
      table_of_.push_back(0);
      continue;
    }
    const auto [place, fresh] = places.try_emplace(robot.table.get(), common_.size());
    if (fresh) common_.push_back(std::make_unique<Common>());
    table_of_.push_back(place->second);
  }
}

const CostMatrix::Common& CostMatrix::common_legs(std::size_t table, const CostTable& costs,
                                                  const std::stop_token& stop) const {
  Common& common = *common_[table];
  std::call_once(common.once, [&] {
    common.loaded.reserve(tasks_.size()), common.empty.reserve(tasks_.size());
    for (const MatrixTask& task : tasks_) {
      Pricer loaded{costs, task.payload_kg, stop}, empty{costs, 0, stop};
      drive_loaded(task, loaded);
      if (task.empty.size() == 1) drive_leg(task.empty[0], empty);
      common.loaded.push_back(loaded.sum), common.empty.push_back(empty.sum);
    }
  });
  return common;
}

void CostMatrix::row(std::size_t r, std::vector<Cell>& cells, const std::stop_token& stop) const {
  const MatrixRobot& robot = robots_[r];
  cells.assign(tasks_.size(), Cell{});
  if (robot.table == nullptr) {
    for (Cell& cell : cells) cell.obstacle = Obstacle::model;
    return;
  }
  const CostTable& costs = *robot.table;
  const auto& [once, loaded, common_empty] = common_legs(table_of_[r], costs, stop);
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const MatrixTask& task = tasks_[t];
    Cell& cell = cells[t];
    cell.obstacle = obstacle_of(task, robot.payload_limit_kg, robot.pose.has_value());
    if (cell.obstacle != Obstacle::none) continue;
    // In this order: sums of equal cells are equal to the last bit.
    Pricer empty{costs, 0, stop}, at_pickup{costs, task.payload_kg, stop};
    if (task.empty.size() == 1)
      empty.sum = common_empty[t];
    else
      drive_empty(task, r, robot.pose, empty);
    turn_at_pickup(task, robot.pose, at_pickup);
    LegCost sum = loaded[t];
    sum += empty.sum;
    sum += at_pickup.sum;
    const double dwell = task.stations.dwell_s();
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
