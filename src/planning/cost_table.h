#pragma once

#include <cmath>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/error.h"
#include "planning/problem.h"
#include "robot/robot_model.h"

namespace joulecast::planning {

class Planner;
struct Run;

// The cost of the best motion. NaN where none exists.
struct LegCost {
  double energy_j = 0;
  double duration_s = 0;

  LegCost& operator+=(const LegCost& b) {
    energy_j += b.energy_j, duration_s += b.duration_s;
    return *this;
  }
  friend LegCost operator*(double by, const LegCost& cost) {
    return {by * cost.energy_j, by * cost.duration_s};
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

// Energy and duration of best motions from rest to rest in free time, over length and payload: computed at
// nodes, interpolated by cubics in between, in the logarithm of the length and in the payload. For
// schedulers, which need millions of them. Immutable, any thread.
//
// Motions in free time are one family, with their peak speed as its only parameter; each member's length,
// duration and energy are integrals over the speed (UniformMotion). So a payload's row is computed along the
// family, without a search. Where the planner has neither closed form nor quadrature (losses of gears,
// friction that falls steeply with the speed), its solver computes the nodes, which takes a thousand times as
// long.
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

  // A run by itself, by the planner: some milliseconds. NaN where no motion exists, or once a stop is
  // requested.
  LegCost solved(const Run& run, double payload_kg, const std::stop_token& stop) const;

  double idle_power_w() const { return idle_power_w_; }
  // Largest departure from the planner's own energy or duration, as a fraction, at lengths and payloads
  // midway between the nodes.
  double interpolation_error() const { return interpolation_error_; }
  const std::vector<std::string>& neglected() const { return neglected_; }
  // Why the planner found no motion at some payload, when it found none.
  const std::optional<Error>& obstacle() const { return obstacle_; }
  std::size_t solves() const { return solves_; }  // motions that it took

 private:
  // One payload. Beyond a knee, where a motion reaches its cruising speed, cost is linear in the length.
  struct Row {
    double knee = 0, log_knee = 0, per_log = 1;
    LegCost at_knee, per_length;  // cost there, and per unit of additional length
    std::vector<LegCost> nodes;   // per unit of length, from the shortest length to the knee
  };
  // One motion of a payload: its length and its cost.
  struct Member {
    Member(double way, const LegCost& costs) : length(way), log_length(std::log(way)), cost(costs) {}
    double length, log_length;
    LegCost cost;
  };
  // All motions of a payload that a row needs, by ascending length up to the knee, `per_decade` of them to a
  // factor of ten about.
  struct Walk {
    std::vector<Member> members;
    LegCost per_length;  // beyond the last
  };
  struct Kind;  // straights or turns of one robot

  // Rows over a grid of payloads.
  class Grid {
   public:
    void build(Kind& kind, double payload_limit_kg, CostTable& table);
    LegCost at(double length, double payload_kg) const;

   private:
    static std::optional<double> heaviest(Kind& kind, double payload_limit_kg, CostTable& table);
    double payload_of(double row) const;
    Row row_of(const Walk& walk, double per_decade) const;
    LegCost along(const Row& row, double length, double log_length) const;
    double error_against(Kind& kind, double per_decade) const;

    double shortest_ = 1, log_shortest_ = 0, payload_limit_kg_ = 0;
    bool knees_within_ = true;  // every row's, within the range of lengths
    std::vector<Row> rows_;     // payloads from none to the limit; none where nothing moves
  };

  Grid straight_, turn_;
  std::shared_ptr<const Planner> planner_;  // of the robot without neglected effects
  Problem problem_;
  double idle_power_w_ = 0, interpolation_error_ = 0;
  std::vector<std::string> neglected_;
  std::optional<Error> obstacle_;
  std::size_t solves_ = 0;
};

// Recently used cost tables, one for each different robot model and way of driving: robots that differ only
// in name and battery share one. Any thread; a table is built outside the lock, by each thread that finds it
// missing.
class CostTableCache {
 public:
  explicit CostTableCache(std::size_t capacity = 4096) : capacity_(capacity) {}

  Result<std::shared_ptr<const CostTable>> get(const robot::RobotModel& robot, const CostOptions& options,
                                               std::stop_token stop = {});
  std::size_t size() const;

 private:
  struct Entry {
    robot::RobotModel robot;  // without name and battery, but for the voltage
    CostOptions options;
    std::shared_ptr<const CostTable> table;
  };
  std::shared_ptr<const CostTable> find(const robot::RobotModel& robot, const CostOptions& options);

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // the latest used first
};

}  // namespace joulecast::planning
