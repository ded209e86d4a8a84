#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "forecast/leg.h"
#include "forecast/scores.h"
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

// The pace of a robot without a habit: 0.7 of its limits, without pauses.
Pace default_pace(const robot::RobotModel& robot);

// Part of a pace that a plan states; absent members follow the robot's habit.
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
  double legs = 0;         // observed
  double share = 0;        // of them that a halt followed
  double mean_s = 0;       // legs that none followed count 0
  double variance_s2 = 0;  // likewise
};

// A robot's usual behaviour, used where a plan states nothing.
struct Habit {
  // Equally likely cruises for each LegKind: the harmonic means of eight parts of the observed legs, so that
  // mean durations are unbiased. Never empty.
  std::array<std::vector<Cruise>, leg_kind_count> cruises;
  std::array<Halts, 2> halts;  // after drives, after turns
  double halt_dispersion = 1;  // variance of a mission's halts over that of independent halts
  Pace middle;                 // medians, and the mean halt

  // The habit with the stated members replaced.
  Habit with(const StatedPace& stated) const;
  // Of so many stops after drives and after turns, each second counting `unit`. The variance includes the
  // uncertainty of the habit.
  HaltDistribution standing(const std::array<double, 2>& stops, double unit) const;
};

// A cruise over mean speed at which a leg is all ramp: it was too short for its cruise.
bool all_ramp(double speed, double duration_s, double way);

// From a robot's recent missions. The pace of the robot's kind counts as five legs, without one the default
// as half a leg; a robot's drives together count as five of its straight ones and of its curves. The halts of
// the kind count as five legs. Standing before a mission's first leg counts as the halt after its last.
Habit habit_of(const robot::RobotModel& robot, std::span<const PastMission> missions,
               const Habit* kind = nullptr);
// The habit of a kind of robots, each counting the same.
Habit habit_of_kind(std::span<const Habit* const> robots);

}  // namespace joulecast::forecast
