#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "forecast/correction.h"
#include "forecast/habit.h"
#include "forecast/scores.h"

namespace joulecast::forecast {

// What a plan states of a leg: cruise and ramps, the cruise alone, or neither. The rest follows the habit.
enum class Driving { stated, paced, usual };

// Subjects that are learned of a robot: its energy and its duration by what a plan states of legs.
enum class Subject {
  stated_energy,
  paced_energy,
  usual_energy,
  stated_duration,
  paced_duration,
  usual_duration
};
inline constexpr std::size_t driving_count = 3, subject_count = 6;
constexpr Subject energy_of(Driving driving) {
  return static_cast<Subject>(driving);
}
constexpr Subject duration_of(Driving driving) {
  return static_cast<Subject>(static_cast<std::size_t>(driving) + driving_count);
}
constexpr bool is_duration(Subject subject) {
  return subject >= Subject::stated_duration;
}
constexpr Driving driving_of(Subject subject) {
  return static_cast<Driving>(static_cast<std::size_t>(subject) % driving_count);
}

// Relative deviations of the energies or durations of a robot's legs.
struct Scatter {
  std::array<double, motion_count> legs{};  // of a leg, by motion
  double common = 0;                        // that all legs of a mission share
};

// The findings of one robot alone.
struct OwnFinding {
  Correction correction;  // with the untried prior
  Scatter scatter;        // with the untried robot's
  std::vector<Scores::Entry> scores;
  std::int64_t missions = 0;
  Habit habit;
};

// Findings of the other robots of a robot's kind.
struct Siblings {
  Correction prior = untried();
  std::vector<Scores::Entry> scores;
  std::int64_t robots = 0;
  std::optional<Habit> habit;      // equal parts of theirs
  std::optional<Scatter> scatter;  // root mean squares of theirs
};

// Hierarchical shrinkage: the kind's factors are the robots' means, weighted by 1 / (own variance + variance
// between robots) and drawn to the untried prior; the variance between robots is the variance of the findings
// less their own variances, and at least that of a deviation of 5 % with the weight of three robots.
Siblings pool(std::span<const OwnFinding* const> others);

}  // namespace joulecast::forecast
