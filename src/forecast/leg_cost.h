#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "dynamics/drive_model.h"
#include "dynamics/straight.h"
#include "forecast/habit.h"
#include "forecast/leg.h"
#include "planning/path.h"
#include "robot/robot_model.h"

namespace joulecast::forecast {

using planning::PlannedLeg;

// A leg's energy by a model [J]: the standing power over its duration, and the rest.
struct LegCost {
  double duration_s = 0;
  double standing_j = 0;
  double motor_j = 0;
  double speed_fraction = 0;  // cruise over the robot's limit
  double runs_on = 0;         // 1: a past leg that may last into the time of the halt after it
  bool slower = false;        // than wanted, limited by the motors
  bool impossible = false;    // the motors cannot move the robot; the costs are of standing still
};

// The cruise that the motors reach, within the current limit and the battery's nominal voltage.
struct Reachable {
  Cruise cruise;
  bool moves = true;
  double creeping_voltage_v = 0;  // of the worse armature, barely moving; where the motors bound the cruise
  double creeping_current_a = 0;
};

// Prices legs driven as trapezoids, no faster than the motors reach, through a drive model, by 4-point
// Gauss-Legendre over each ramp (exact where power is a polynomial of speed up to degree 7). Places are
// unknown: effects tied to the floor have no effect.
class LegPricer {
 public:
  LegPricer(const robot::RobotModel& robot, const dynamics::DriveModel& drive);

  double standing_w() const { return standing_w_; }

  // A past leg as it was driven; `planned`: as it was commanded, where that is known.
  LegCost driven(const Leg& leg, bool planned = false) const;
  LegCost paced(const PlannedLeg& leg, const Cruise& cruise) const;
  LegCost paced(const PlannedLeg& leg, const Pace& pace) const;
  // The mean over a habit's cruises.
  LegCost usual(const PlannedLeg& leg, const Habit& habit) const;
  // A past leg's way, likewise.
  LegCost usual(const Leg& leg, const Habit& habit) const;
  Reachable reachable(Motion motion, double curvature_1_m, double payload_kg, const Cruise& wanted) const;
  // Of a leg that is impossible: the limit that prevents motion, and the value that motion requires.
  Error obstacle(const PlannedLeg& leg) const;
  LegCost standing(double duration_s) const { return {duration_s, standing_w_ * duration_s, 0, 0}; }

 private:
  // Power beyond standing of one kind of motion with one payload and curvature.
  struct Power {
    Motion motion = Motion::drive;
    double curvature_1_m = 0;
    double payload_kg = 0;
    std::optional<dynamics::QuadraticPower> closed;
    bool tried = false;    // to find the closed form
    bool unbound = false;  // the motors reach the robot's limits of speed and acceleration together
  };

  LegCost priced(const Power& kind, double way, Cruise cruise) const;
  LegCost trapezoid(const Power& kind, double way, double speed, double ramp_s) const;
  dynamics::Instant instant(const Power& kind, double speed, double acceleration) const;
  bool reaches(const Power& kind, double speed, double acceleration) const;
  Reachable reachable(const Power& kind, const Cruise& wanted) const;
  Cruise greatest(Motion motion) const;  // that the limits allow
  double power_w(const Power& kind, double speed, double acceleration) const;
  // `often`: so many prices are requested that a curve's closed form saves time.
  const Power& power_of(Motion motion, double curvature_1_m, double payload_kg, bool often) const;
  std::optional<dynamics::QuadraticPower> closed_form(const Power& kind) const;

  const dynamics::DriveModel* drive_;
  robot::Limits limits_;
  double voltage_limit_v_, current_limit_a_;  // 0: none
  double standing_w_;
  mutable std::vector<Power> known_;
};

// A pace that a robot's motors do not reach with a payload, within its current limit and its battery's
// nominal voltage.
struct Limitation {
  bool moves = true;  // slower, at `reached`; else not at all
  Pace reached;
  std::string sentence;
};

// Straight ahead and turning in place; empty where the pace is reached.
std::optional<Limitation> limitation(const LegPricer& pricer, const robot::RobotModel& robot,
                                     const Pace& wanted, double payload_kg);

}  // namespace joulecast::forecast
