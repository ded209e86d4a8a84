#pragma once

#include <array>
#include <cstddef>

#include "forecast/scores.h"

namespace joulecast::forecast {

// The distribution of halts that a plan does not state, in the unit of a prediction: none with a probability,
// else gamma distributed with the mean and variance of all; equally likely values of it.
class HaltDistribution {
 public:
  static constexpr std::size_t count = 12;

  HaltDistribution() = default;
  HaltDistribution(double mean, double variance, double probability_of_none);

  bool none() const { return !(mean_ > 0); }
  double mean() const { return mean_; }
  double variance() const { return variance_; }
  double probability_of_none() const { return none_; }
  double weight() const { return (1 - none_) / static_cast<double>(count); }  // of each value
  const std::array<double, count>& values() const { return values_; }         // ascending

 private:
  double mean_ = 0, variance_ = 0, none_ = 1;
  std::array<double, count> values_{};
};

// Energy [J] or duration [s] of a plan: fixed + legs * exp(spread * n) + halts, n standard normal, is the
// model's distribution; its quantile at Phi(inflation * z), z distributed as `scores`, is the forecast. The
// scores are those of past missions under the same formula, so that they calibrate every shape of it.
struct Prediction {
  double fixed = 0;  // exact
  double legs = 0;
  double spread = 0;
  double scatter = 0;  // the spread without the correction's error
  HaltDistribution halts;
  double inflation = 1;
  const ScoreDistribution* scores = nullptr;  // of the Forecaster

  // The sum of the legs' means, as corrected amounts are means.
  double expected() const { return fixed + legs + halts.mean(); }
  double quantile(double probability) const;
  // The probability of at most an amount with a standard deviation (0: exact).
  double probability_below(double amount, double deviation = 0) const;
  // The score of the measured amount: the normal deviate with the probability of staying below it.
  double score_of(double amount) const;

 private:
  double below(double amount) const;
  double at_score(double z) const;
};

}  // namespace joulecast::forecast
