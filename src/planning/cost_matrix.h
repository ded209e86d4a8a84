#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string_view>
#include <vector>

#include "planning/cost_table.h"
#include "planning/path.h"

namespace joulecast::planning {

// A way between two stops, each segment from rest to rest, in this order: straight segments, turns in place,
// runs that a cost table does not contain, and dwells. The task determines the payload.
using Leg = std::vector<PlannedLeg>;
Leg leg_of(const Path& path);

// Where something is fetched or brought; the robot turns to `heading_rad` when there is one.
struct Station {
  double x_m = 0, y_m = 0;
  std::optional<double> heading_rad;
};

// Times at rest; a stated one, possibly 0, means that no other halts are predicted.
struct Stations {
  std::optional<Station> pickup, dropoff;
  std::optional<double> pickup_dwell_s, dropoff_dwell_s;

  bool halts_stated() const { return pickup_dwell_s || dropoff_dwell_s; }
  double dwell_s() const { return pickup_dwell_s.value_or(0) + dropoff_dwell_s.value_or(0); }
};

struct MatrixRobot {
  std::shared_ptr<const CostTable> table;  // null: the robot has no model
  double payload_limit_kg = 0;
  std::optional<Pose> pose;  // its position; required by tasks without an empty leg
};

// Fetch at the pick-up, bring to the drop-off. A leg that is given goes before the stations.
struct MatrixTask {
  double payload_kg = 0;
  Stations stations;
  std::vector<Leg> empty;  // none, one for all robots, or one a robot
  std::optional<Leg> loaded;
};

// The segments that the robot of that row drives for a task, in order, with its dwells. `pose` is required
// if the task has no empty leg.
std::vector<PlannedLeg> legs_of(const MatrixTask& task, std::size_t robot, const std::optional<Pose>& pose);

enum class Obstacle : unsigned char {
  none,
  payload,  // heavier than the robot may carry
  limits,   // no motion within the robot's limits with this payload
  pose,     // the robot's position is unknown, and the task has no empty leg
  model     // the robot has no model
};
std::string_view name_of(Obstacle obstacle);
// The obstacle found before any motion is priced: payload or pose.
Obstacle obstacle_of(const MatrixTask& task, double payload_limit_kg, bool pose_known);

// One robot doing one task. NaN where an obstacle exists.
struct Cell {
  double energy_j = std::numeric_limits<double>::quiet_NaN();
  double duration_s = std::numeric_limits<double>::quiet_NaN();
  LegCost loaded;  // of both, from pick-up to drop-off
  Obstacle obstacle = Obstacle::none;
};

// Robots x tasks. Several threads may compute rows at the same time.
class CostMatrix {
 public:
  // Each task has stations or legs for both ways: the caller has checked.
  CostMatrix(std::vector<MatrixRobot> robots, std::vector<MatrixTask> tasks);

  std::size_t robots() const { return robots_.size(); }
  std::size_t tasks() const { return tasks_.size(); }
  const MatrixRobot& robot(std::size_t row) const { return robots_[row]; }

  // The robot's cells, one a task. Once a stop is requested, those with other runs become obstacles.
  void row(std::size_t robot, std::vector<Cell>& cells, const std::stop_token& stop = {}) const;

 private:
  // Loaded legs, and empty ones of all robots, depend on the robot's table only.
  struct Common {
    std::once_flag once;
    std::vector<LegCost> loaded, empty;
  };
  const Common& common_legs(std::size_t table, const CostTable& costs, const std::stop_token& stop) const;

  std::vector<MatrixRobot> robots_;
  std::vector<MatrixTask> tasks_;
  std::vector<std::size_t> table_of_;  // robot -> place in common_
  mutable std::vector<std::unique_ptr<Common>> common_;
};

}  // namespace joulecast::planning
