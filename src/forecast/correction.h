#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "forecast/leg_cost.h"

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

// Parts of a robot's energy, in joules of its model: standing, driving, turning in place, driving weighted by
// payload over its limit, driving weighted by speed over its limit less 0.6.
inline constexpr std::size_t feature_count = 5, payload_feature = 3;
using Features = std::array<double, feature_count>;

Features features_of(Motion motion, double payload_fraction, const LegCost& cost);
// The same of durations [s], of moving legs: the duration of halts is not corrected.
Features duration_features_of(Motion motion, double payload_fraction, const LegCost& cost);

// The robot against its model: energy = sum of mean[k] * features[k]. (1, 1, 1, 0, 0) is the model itself.
struct Correction {
  Features mean{1, 1, 1, 0, 0};
  std::array<Features, feature_count> covariance{};

  double energy_j(const Features& x) const;
  double variance_j2(const Features& x) const;
};

// The prior of an unmeasured robot. Of its energies, standard deviations of 15 % of its standing power, 25 %
// of driving and of turning (with 15 % intervals covered 78 % after one mission of robots that do not follow
// their plans, with 25 % 96 %, with 30 % 99 %), 10 % of the factor of speed and 35 % of that of payload, as
// robot files rarely contain the rolling resistance of payloads (with 15 % the intervals of first payloads
// covered 60 %, with 30 % 84 to 94 %, with 40 % 97 %). The factors of turning and of payload have a
// correlation of 0.5 with that of driving, as friction that is above the file's is so for all, and none
// beyond that: first payloads took 3.1 % more than their median forecast without, 1.4 % with 0.3 and 0.2 %
// with 0.5. Of its durations, 5 % of driving, turning and speed and 2 % of payload: after 30 missions 100
// robots of an independent plant and 24 virtual ones have learned factors whose root mean squares are at most
// 0.04, 0.03, 0.05 and 0.02. Their drives are as long as planned or usual, with any payload.
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

}  // namespace joulecast::forecast
