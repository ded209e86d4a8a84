#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "forecast/habit.h"
#include "forecast/leg_cost.h"
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

struct Correction;

// Parts of a robot's energy, in joules of its model: standing, driving, turning in place, moving weighted by
// payload over its limit, driving weighted by speed over its limit less 0.6. The payload's part is relative
// to the corrected motion: what resists more than the model resists a payload more, too.
inline constexpr std::size_t feature_count = 5, payload_feature = 3;
using Features = std::array<double, feature_count>;

Features features_of(Motion motion, double payload_fraction, const LegCost& cost, const Correction& now);
// The same of durations [s], of moving legs: the duration of halts is not corrected. The first part is that
// of a motion in the time of the halt that follows.
Features duration_features_of(Motion motion, double payload_fraction, const LegCost& cost,
                              const Correction& now);

// The robot against its model: energy = sum of mean[k] * features[k]. (1, 1, 1, 0, 0) is the model itself,
// of durations (0, 1, 1, 0, 0).
struct Correction {
  Features mean{1, 1, 1, 0, 0};
  std::array<Features, feature_count> covariance{};

  double energy_j(const Features& x) const;
  double variance_j2(const Features& x) const;
};

// The prior of an unmeasured robot, by departures from the model that 200 robots of an independent plant and
// 24 virtual ones have learned after 30 missions. Their root mean squares are, of energies: standing 0.20 and
// 0.19, driving 0.43 and 0.48, turning 1.58 and 1.28, speed 0.12 and 0.33. The deviations are these, with
// equal weights of both, times sqrt(3/5), as a t distribution of 5 degrees of freedom exceeds its scale.
// First payloads are forecast without evidence, so payload's is not lessened: 0.25 and 0.13, of 18 and 12
// robots. Correlations about the model are, of driving and turning, 0.87 and 0.76, of driving and payload
// 0.73 and 0.57, of turning and payload 0.82 and 0.57: their means. Of stated durations, of the 100 that
// follow plans inexactly: driving 0.072, turning 0.056, speed 0.052, likewise, payload at most 0.01; a motion
// outlasts its command by 0.05 to 0.12 s.
Correction untried(Subject subject);

// Each factor's prior is a t distribution of 5 degrees of freedom, which far evidence overrules: a normal one
// of uncertain precision. The expected share of the prior's precision, of a factor that is estimated `off`
// its prior with a variance (expectation maximisation); 1 without evidence.
double prior_share(double off, double variance, double prior_variance);
inline constexpr int prior_rounds = 6;  // settle estimate and share

// One leg's evidence.
struct Evidence {
  Features features{};
  double battery_j = 0;
  double deviation_j = 0;  // standard deviation of the leg's own scatter, > 0
};

// Bayesian least squares for the correction, in information form. Old evidence fades by forget().
class CorrectionFit {
 public:
  void forget(double keep);
  // Removes the evidence of another fit, `share` of it.
  void remove(const CorrectionFit& other, double share);
  // Adds the legs of one mission: each with its own scatter, and one factor of standard deviation `common`
  // that all share (generalised least squares: a mission contributes once to the common level, for any number
  // of legs).
  void add(std::span<const Evidence> mission, double common, const Correction& now);
  Correction posterior(const Correction& prior) const;

 private:
  std::array<Features, feature_count> information_{};
  Features weighted_{};  // information times estimate
};

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
