#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace joulecast::forecast {

// The predictive distribution of one standardised score z = log(measured / expected) / spread, as atoms of
// equal weight at its quantiles (k + 1/2) / count, ascending.
class ScoreDistribution {
 public:
  static constexpr std::size_t count = 96;

  ScoreDistribution();  // the reference alone
  explicit ScoreDistribution(const std::array<double, count>& atoms) : atoms_(atoms) {}

  double quantile(double probability) const;
  // Of a score at or below `z`: straight between atoms; beyond the outermost, which leave 1/192 on either
  // side, the rest fades by a factor e each half deviation.
  double probability(double z) const;
  // Of the normal distribution with the same 90 % interval.
  double deviation() const { return (quantile(0.95) - quantile(0.05)) / (2 * 1.6448536269514722); }
  std::span<const double, count> atoms() const { return atoms_; }

 private:
  std::array<double, count> atoms_;
};

// The scores of one robot's past missions, each from before the mission was learned: the calibration scores
// of split conformal prediction. Newer ones weigh more (exchangeability fails slowly; Barber, Candes, Ramdas
// and Tibshirani 2023).
class Scores {
 public:
  static constexpr double keep = 0.99;  // of a score's weight when a newer one comes
  static constexpr std::size_t most = 300;

  // `weight`, 0 to 1: similarity of the scored forecast to future ones.
  void add(double score, double weight = 1);
  void discount(double share);  // of all weights so far: a change made them less relevant
  double weight() const;        // sum of weights

  struct Entry {
    double score = 0, weight = 0;
  };
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  std::vector<Entry> entries_;
};

// Own scores, filled up to `own_enough` by siblings' (Mondrian by robot, widened to the kind while own scores
// are few), and a reference of weight `reference_weight`: Student's t of 5 degrees of freedom, which gives
// small samples a tail. Its variance is that of the scores, to which 1, the variance of scores whose spread
// is right, counts as `reference_weight` more: forecasts that were too wide or too narrow from the start
// narrow or widen after few missions. Quantiles leave room for the score to come (the n + 1st point of
// conformal prediction). By simulation (2 to 60 scores, deviations of 0.4 to 2, skewed, two-humped and heavy
// tails) 88 to 93 % of next scores fall inside the 90 % interval where scores have the reference's variance
// or are 20.
inline constexpr double own_enough = 30;
inline constexpr double reference_weight = 4;
ScoreDistribution pooled_scores(const Scores& own, std::span<const Scores::Entry> siblings);

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
  double quantile(double probability) const { return at_score(inflation * scores->quantile(probability)); }
  // The probability of at most an amount with a standard deviation (0: exact).
  double probability_below(double amount, double deviation = 0) const;
  // The score of the measured amount: the normal deviate with the probability of staying below it.
  double score_of(double amount) const;

 private:
  double below(double amount) const;
  double at_score(double z) const;
};

}  // namespace joulecast::forecast
