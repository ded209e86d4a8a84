#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "forecast/correction.h"
#include "forecast/scores.h"

namespace joulecast::forecast {

// Whether the plan states the pace of legs, or leaves it to the robot's habit.
enum class Driving { stated, usual };

// Subjects that are learned of a robot: its energy on legs with a stated pace, and its energy and duration on
// legs at its own pace.
enum class Subject { stated_energy, usual_energy, usual_duration };
inline constexpr std::size_t subject_count = 3;

// The findings of one robot alone.
struct OwnFinding {
  Correction correction;  // with the untried prior
  std::vector<Scores::Entry> scores;
  std::int64_t missions = 0;
};

// Findings of the other robots of a robot's kind.
struct Siblings {
  Correction prior = untried();
  std::vector<Scores::Entry> scores;
  std::int64_t robots = 0;
};

// Hierarchical shrinkage: the kind's factors are the robots' means, weighted by 1 / (own variance + variance
// between robots) and drawn to the untried prior; the variance between robots is the variance of the findings
// less their own variances, and at least that of a deviation of 5 % with the weight of three robots.
Siblings pool(std::span<const OwnFinding* const> others);

}  // namespace joulecast::forecast
