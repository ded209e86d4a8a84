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

// The segments of a leg go to `driver`, which has straight(m), turn(rad), other(run) and stand(s).

template <class Driver>
void drive(const Leg& leg, Driver& driver) {
  for (const double d : leg.distances_m) driver.straight(d);
  for (const double a : leg.turns_rad) driver.turn(a);
  for (const auto& run : leg.others) driver.other(run);
  for (const double s : leg.dwells_s) driver.stand(s);
}

// Turn towards the place, drive there, turn to its heading.
template <class Driver>
void drive_between(const Pose& from, const Station& to, Driver& driver) {
  const double dx = to.x_m - from.x_m, dy = to.y_m - from.y_m, distance = std::hypot(dx, dy);
  double heading = from.heading_rad;
  if (distance > same_place_m) {
    const double way = std::atan2(dy, dx);
    driver.turn(angle_between(heading, way));
    driver.straight(distance);
    heading = way;
  }
  if (to.heading_rad) driver.turn(angle_between(heading, *to.heading_rad));
}

template <class Driver>
void drive_loaded(const MatrixTask& task, Driver& driver) {
  if (task.loaded) return drive(*task.loaded, driver);
  // Without a heading at the pick-up the robot keeps its direction of arrival; see turn_at_pickup().
  const Station &from = *task.stations.pickup, &to = *task.stations.dropoff;
  const double way = std::atan2(to.y_m - from.y_m, to.x_m - from.x_m);
  drive_between({from.x_m, from.y_m, from.heading_rad.value_or(way)}, to, driver);
}

template <class Driver>
void drive_empty(const MatrixTask& task, std::size_t robot, const std::optional<Pose>& pose, Driver& driver) {
  if (task.empty.empty()) return drive_between(*pose, *task.stations.pickup, driver);
  drive(task.empty.size() == 1 ? task.empty[0] : task.empty[robot], driver);
}

// From the heading in which the robot came to a pick-up that has none, towards the drop-off.
template <class Driver>
void turn_at_pickup(const MatrixTask& task, const std::optional<Pose>& pose, Driver& driver) {
  if (!task.empty.empty() || task.loaded || task.stations.pickup->heading_rad) return;
  const Station &from = *task.stations.pickup, &to = *task.stations.dropoff;
  if (!(std::hypot(to.x_m - from.x_m, to.y_m - from.y_m) > same_place_m)) return;
  const double dx = from.x_m - pose->x_m, dy = from.y_m - pose->y_m;
  const double arrived = std::hypot(dx, dy) > same_place_m ? std::atan2(dy, dx) : pose->heading_rad;
  driver.turn(angle_between(arrived, std::atan2(to.y_m - from.y_m, to.x_m - from.x_m)));
}

// Sums the costs in a table.
struct Pricer {
  const CostTable& table;
  double payload_kg = 0;
  std::stop_token stop = {};
  LegCost sum = {};
  void straight(double distance_m) { sum += table.straight(distance_m, payload_kg); }
  void turn(double angle_rad) { sum += table.turn(angle_rad, payload_kg); }
  void other(const std::shared_ptr<const Run>& run) { sum += table.solved(*run, payload_kg, stop); }
  void stand(double s) { sum += {table.idle_power_w() * s, s}; }
};

struct Recorder {
  std::vector<Stretch>& into;
  bool loaded = false;
  void straight(double distance_m) { into.push_back({Stretch::Kind::straight, distance_m, loaded}); }
  void turn(double angle_rad) { into.push_back({Stretch::Kind::turn, std::fabs(angle_rad), loaded}); }
  void other(const std::shared_ptr<const Run>& run) {
    into.push_back({Stretch::Kind::other, run->length(), loaded, run});
  }
  void stand(double s) { into.push_back({Stretch::Kind::stand, s, loaded}); }
};

}  // namespace

std::string_view name_of(Obstacle obstacle) {
  constexpr std::array<std::string_view, 5> names = {"none", "payload", "limits", "pose", "model"};
  static_assert(static_cast<Obstacle>(names.size() - 1) == Obstacle::model);
  return names[static_cast<std::size_t>(obstacle)];
}

Leg leg_of(const Path& path) {
  Leg leg;
  for (const Run& run : path.runs) {
    leg.dwells_s.push_back(run.dwell_before_s);
    if (run.turn != 0 && run.length() <= widest_turn_rad)
      leg.turns_rad.push_back(run.length());
    else if (run.turn == 0 && run.straight() && run.length() <= longest_leg_m)
      leg.distances_m.push_back(run.length());
    else
      leg.others.push_back(std::make_shared<const Run>(run));
  }
  leg.dwells_s.push_back(path.dwell_after_s);
  return leg;
}

Obstacle obstacle_of(const MatrixTask& task, double payload_limit_kg, bool pose_known) {
  if (task.payload_kg > payload_limit_kg) return Obstacle::payload;
  return task.empty.empty() && !pose_known ? Obstacle::pose : Obstacle::none;
}

void stretches_of(const MatrixTask& task, std::size_t robot, const std::optional<Pose>& pose,
                  std::vector<Stretch>& stretches) {
  stretches.clear();
  Recorder empty{stretches, false}, loaded{stretches, true};
  drive_empty(task, robot, pose, empty);
  empty.stand(task.stations.pickup_dwell_s.value_or(0));
  turn_at_pickup(task, pose, loaded);
  drive_loaded(task, loaded);
  loaded.stand(task.stations.dropoff_dwell_s.value_or(0));
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
      if (task.empty.size() == 1) drive(task.empty[0], empty);
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
