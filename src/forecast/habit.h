#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "forecast/leg.h"
#include "forecast/prediction.h"
#include "robot/robot_model.h"

namespace joulecast::forecast {

// How fast a robot drives and turns: cruise and ramps of a trapezoid, and how long it stands after a leg.
struct Pace {
  double speed_m_s = 0;
  double acceleration_m_s2 = 0;
  double yaw_rate_rad_s = 0;
  double yaw_acceleration_rad_s2 = 0;
  double pause_s = 0;  // on average, legs that no halt follows counting 0
};

// The pace of a robot whose habit is not known: 0.7 of its limits, without pauses.
Pace default_pace(const robot::RobotModel& robot);

// Part of a pace that a plan states; what is absent is the robot's habit.
struct StatedPace {
  std::optional<double> speed_m_s, acceleration_m_s2, yaw_rate_rad_s, yaw_acceleration_rad_s2;

  // Whether the cruise of a leg is stated, and whether its ramps are as well. Standing states itself.
  bool cruise(Motion motion) const;
  bool whole(Motion motion) const;
};

// A jump of speed would cost infinite power.
inline constexpr double least_ramp_s = 0.02;

// Cruise and ramp of one leg: m or rad.
struct Cruise {
  double speed = 0;
  double acceleration = 0;
};

// Legs that differ in how fast they are driven.
enum class LegKind { straight, curve, turn };
inline constexpr std::size_t leg_kind_count = 3;
// A drive that turns by less than this over its way counts as straight [rad].
inline constexpr double straight_until_rad = 0.3;
LegKind kind_of(Motion motion, double way, double curvature_1_m);

// Standing after one leg.
struct Halts {
  double legs = 0;         // seen
  double share = 0;        // of them that a halt followed
  double mean_s = 0;       // legs that none followed count 0
  double variance_s2 = 0;  // likewise
};

// What a robot does where a plan does not say.
struct Habit {
  // Equally likely ones, for each LegKind: the harmonic means of eight parts of what was seen, so that
  // durations are right in the mean. Never empty.
  std::array<std::vector<Cruise>, leg_kind_count> cruises;
  std::array<Halts, 2> halts;  // after drives, after turns
  double halt_dispersion = 1;  // variance of what a mission stands, over that of independent halts
  Pace middle;                 // medians, and the mean halt

  // What is stated replaces the habit.
  Habit with(const StatedPace& stated) const;
  // Of so many stops after drives and after turns, each second counting `unit`; how well the habit is known
  // is in the variance.
  HaltDistribution standing(const std::array<double, 2>& stops, double unit) const;
};

// From a robot's recent missions. Of a kind of legs that was seen less than five times the
// default pace is the habit. What a mission stands before its first leg counts to the halt after its last.
Habit habit_of(const robot::RobotModel& robot, std::span<const PastMission> missions);

}  // namespace joulecast::forecast
