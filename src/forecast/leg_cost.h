#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "dynamics/drive_model.h"
#include "dynamics/straight.h"
#include "forecast/leg.h"
#include "planning/path.h"
#include "robot/robot_model.h"

namespace joulecast::forecast {

// How fast a robot drives and turns: cruise and ramps of a trapezoid, and how long it stands at each stop.
struct Pace {
  double speed_m_s = 0;
  double acceleration_m_s2 = 0;
  double yaw_rate_rad_s = 0;
  double yaw_acceleration_rad_s2 = 0;
  double pause_s = 0;
};

// The pace of a robot whose habit is not known: 0.7 of its limits, without pauses.
Pace default_pace(const robot::RobotModel& robot);

// The medians of what past legs show; what too few (5) show is the default's.
Pace usual_pace(const robot::RobotModel& robot, std::span<const Leg> past);

// A stretch of a planned task, from stop to stop.
struct PlannedLeg {
  Motion motion = Motion::stand;
  double way = 0;            // m, rad; 0 when standing
  double curvature_1_m = 0;  // >= 0
  double payload_kg = 0;
  double duration_s = 0;  // when standing
};

// The stretches of a planned path: dwells and runs. A run whose curvature varies counts with its mean.
std::vector<PlannedLeg> planned_legs(const planning::Path& path);

// What a model expects of a leg [J]: the standing power over its duration, and the rest.
struct LegCost {
  double duration_s = 0;
  double standing_j = 0;
  double motor_j = 0;
  double speed_fraction = 0;  // cruise over the robot's limit
};

// Prices legs driven as trapezoids through a drive model, by 4-point Gauss-Legendre over each ramp (exact
// where power is a polynomial of speed up to degree 7). Places are unknown: effects tied to the floor do
// nothing.
class LegPricer {
 public:
  LegPricer(const robot::RobotModel& robot, const dynamics::DriveModel& drive);

  double standing_w() const { return standing_w_; }

  // A past leg as it was driven.
  LegCost driven(const Leg& leg) const;
  // A past leg's way, at a pace.
  LegCost paced(const Leg& leg, const Pace& pace) const;
  LegCost paced(const PlannedLeg& leg, const Pace& pace) const;
  LegCost standing(double duration_s) const;

 private:
  // Power beyond standing of one kind of motion with one payload and curvature.
  struct Power {
    Motion motion = Motion::drive;
    double curvature_1_m = 0;
    double payload_kg = 0;
    std::optional<dynamics::QuadraticPower> closed;
  };

  LegCost trapezoid(Motion motion, double way, double curvature_1_m, double payload_kg, double speed,
                    double ramp_s) const;
  double power_w(const Power& kind, double speed, double acceleration) const;
  const Power& power_of(Motion motion, double curvature_1_m, double payload_kg) const;
  std::optional<dynamics::QuadraticPower> closed_form(const Power& kind) const;

  const dynamics::DriveModel* drive_;
  robot::Limits limits_;
  double standing_w_;
  mutable std::vector<Power> known_;
};

}  // namespace joulecast::forecast
