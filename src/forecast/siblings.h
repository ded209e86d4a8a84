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
  Correction prior;
  std::vector<Scores::Entry> scores;
  std::int64_t robots = 0;
  std::optional<Habit> habit;      // equal parts of theirs
  std::optional<Scatter> scatter;  // root of the harmonic mean of their variances
};

// Hierarchical shrinkage: the kind's factors are the robots' means, weighted by 1 / (own variance + variance
// between robots) and drawn to the untried prior; the variance between robots is the variance of the findings
// less their own variances, and at least that of 0.13 of the prior's deviation with the weight of three
// robots: robots of the independent plant's kinds differ by 0.05 to 0.2 of it.
Siblings pool(Subject subject, std::span<const OwnFinding* const> others);

}  // namespace joulecast::forecast
