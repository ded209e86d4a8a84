#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/error.h"
#include "planning/problem.h"
#include "robot/robot_model.h"

namespace joulecast::planning {

// What the best motion costs. NaN where none exists.
struct LegCost {
  double energy_j = 0;
  double duration_s = 0;

  LegCost& operator+=(const LegCost& b) {
    energy_j += b.energy_j, duration_s += b.duration_s;
    return *this;
  }
};

// The way in which legs are driven; a table belongs to one robot model and one of these.
struct CostOptions {
  double value_of_time_w = 0;
  std::optional<double> regeneration;  // as Problem's

  friend bool operator==(const CostOptions&, const CostOptions&) = default;
};

inline constexpr double longest_leg_m = 1e4;
inline constexpr double widest_turn_rad = 314.16;

// Energy and duration of best motions from rest to rest in free time, over length and payload: solved at
// nodes, interpolated by cubics in between, in the logarithm of the length and in the payload. For
// schedulers, who ask for millions. Immutable, any thread.
class CostTable {
 public:
  // Effects tied to places or headings of the floor are left out, since a leg here has no place; see
  // neglected(). Limits are those of the robot file.
  // Fault::stopped soon after a stop is requested.
  static Result<CostTable> make(const robot::RobotModel& robot, const CostOptions& options,
                                std::stop_token stop = {});

  // 0 <= distance_m <= longest_leg_m, 0 <= payload_kg <= the robot's limit.
  LegCost straight(double distance_m, double payload_kg) const;
  // Turning in place by that angle, either way; |angle_rad| <= widest_turn_rad.
  LegCost turn(double angle_rad, double payload_kg) const;

  double idle_power_w() const { return idle_power_w_; }
  // Largest departure from the planner's own energy or duration, as a fraction, at lengths and payloads
  // midway between the nodes.
  double interpolation_error() const { return interpolation_error_; }
  const std::vector<std::string>& neglected() const { return neglected_; }
  // Why the planner found no motion at some payload, when it found none.
  const std::optional<Error>& obstacle() const { return obstacle_; }
  std::size_t solves() const { return solves_; }  // planner calls that it took

 private:
  // One kind of motion over a grid of payloads and logarithms of length. Beyond a knee, where a motion
  // reaches its cruising speed, cost is linear in the length.
  class Grid {
   public:
    using Solve = std::function<Result<LegCost>(double length, double payload_kg)>;
    void build(const Solve& solve, double shortest, double longest, double payload_limit_kg,
               CostTable& table);
    LegCost at(double length, double payload_kg) const;

   private:
    struct Node {
      double energy_per_length = 0, duration_per_length = 0;
    };
    // One payload.
    struct Row {
      double knee = 0, per_log = 1;
      LegCost at_knee, per_length;  // cost there, and what a unit of length more costs
      std::vector<Node> nodes;      // from the shortest length to the knee
    };
    double payload_of(double row) const;
    Row row(const Solve& solve, double payload_kg, double longest, CostTable& table) const;
    void fill(const Solve& solve, Row& row, double payload_kg, std::size_t lengths, CostTable& table) const;
    LegCost along(const Row& row, double length, double log_length) const;
    double error_against(const Solve& solve, double longest, CostTable& table) const;

    double shortest_ = 1, log_shortest_ = 0, payload_limit_kg_ = 0;
    std::vector<Row> rows_;  // payloads from none to the limit
  };

  Grid straight_, turn_;
  double idle_power_w_ = 0, interpolation_error_ = 0;
  std::vector<std::string> neglected_;
  std::optional<Error> obstacle_;
  std::size_t solves_ = 0;
  bool numerical_ = false;  // some of them by the numerical solver
};

}  // namespace joulecast::planning
