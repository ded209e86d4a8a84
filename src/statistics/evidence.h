#pragma once

#include <Eigen/Dense>
#include <limits>
#include <span>
#include <vector>

#include "statistics/information.h"

namespace joulecast::statistics {

// Coefficients that are there together or not at all.
struct Candidate {
  std::vector<std::size_t> columns;
  double expected = 1;                                      // sd of each coefficient where it is there
  double least = -std::numeric_limits<double>::infinity();  // bounds of each coefficient
  double most = std::numeric_limits<double>::infinity();
  double log_prior = 0;  // log odds of being there, before any data
};

// The evidence of whitened Gaussian data for sets of candidates, where every coefficient departs from zero by
// its tolerance already (MacKay, Information Theory, chapter 28). Strengths that are bounded on one side have
// the truncated normal as prior; the posterior's mass within the bounds is taken coefficient by coefficient.
class Evidence {
 public:
  // `tolerance`: sd of each column's coefficient without a candidate; 0 fixes it at zero. `selected`: the
  // columns that candidates may have, ascending; empty: any.
  Evidence(const Information& data, const Eigen::VectorXd& tolerance,
           std::span<const std::size_t> selected = {});

  // Log density of the data when none is there.
  double log_density() const { return log_density_; }
  // Log of the density when these are there over that when none is, prior odds included.
  double log_odds(std::span<const Candidate* const> set) const;

  struct Estimate {
    Eigen::VectorXd mean, sd;  // of the set's coefficients, in the order of their columns; within the bounds
    Eigen::MatrixXd covariance;
  };
  Estimate estimate(std::span<const Candidate* const> set) const;

  // Expected log odds of one coefficient at this strength over the best strength of another in its place:
  // half the squared distance that the other cannot follow.
  double separation(std::size_t column, double strength, std::size_t other, double expected) const;

 private:
  struct Posterior {
    Eigen::VectorXd mean;  // in units of the expected sizes
    Eigen::LLT<Eigen::MatrixXd> factor;
    Eigen::VectorXd b;
  };
  bool solve(std::span<const Candidate* const> set, Posterior& posterior) const;

  std::vector<Eigen::Index> place_;  // of each column in `selected`
  // X'K X and X'K y, K the inverse covariance of the data with the tolerances in it; of the columns in
  // `selected`.
  Eigen::MatrixXd xx_;
  Eigen::VectorXd xy_;
  double log_density_ = 0;
};

// All coefficients together with their own normal priors, sd as given: mean and covariance.
struct Ridge {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};
Ridge ridge(const Information& data, const Eigen::VectorXd& sd);

}  // namespace joulecast::statistics
