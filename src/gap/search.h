#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "gap/design.h"

namespace joulecast::gap {

// The information about all coefficients after calibration tolerances have been integrated out, in units of
// each tolerance. What is left to decide is which coefficients are larger than a robot as filed would have.
class Evidence {
 public:
  // `coarsening`: the odds are those of this fraction of the data, 1 for all of them. Formulas hold only so
  // far, and what little they are off by decides nothing once its signal is divided down; Miller and Dunson,
  // Robust Bayesian inference via coarsening, 2019. Estimates take all data.
  Evidence(const ColumnSet& columns, const Information& total, double coarsening = 1);

  // Log of the evidence that these hypotheses hold over that none does, prior odds included. Gaussian
  // integral, corrected for strengths that cannot be negative.
  double log_odds(std::span<const std::size_t> hypotheses) const;

  // Expected log evidence for the first coefficient of hypothesis `a` at this strength over the best
  // coefficient of `b` in its place, half the squared distance that `b` cannot follow.
  double separation(std::size_t a, std::size_t b, double strength) const;

  struct Estimate {
    Eigen::VectorXd mean, sd;  // of all coefficients, in their own units
    Eigen::MatrixXd covariance;
  };
  Estimate estimate(std::span<const std::size_t> hypotheses) const;

  const ColumnSet& columns() const { return columns_; }

 private:
  const ColumnSet& columns_;
  const Information total_;
  Eigen::VectorXd unit_;
  Eigen::MatrixXd xx_;  // of coefficients in units, tolerances integrated out
  Eigen::VectorXd xy_;
};

struct Explanation {
  std::vector<std::size_t> hypotheses;  // ascending
  double log_odds = 0;
};

struct SearchSettings {
  std::size_t most_effects = 4;
  std::size_t beam = 10;
};

// Explanations found by beam search, the empty one among them, best first.
std::vector<Explanation> search(const Evidence& evidence, const SearchSettings& settings = {});

}  // namespace joulecast::gap
