#pragma once

#include <string>
#include <vector>

#include "gap/posterior/walk.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap::posterior {

// A term of battery power in one robust regression; joined ones have " + " in their name and W at the mean
// motion as their unit.
struct Term : BaselineTerm {
  double difference_w = 0, deviation_w = 0;  // measured - model at the mean size of the term
};

// The regressors by row of power. Recordings: constant, |v|, v^2, v^3, half the difference of the sides, v a,
// v sin(climb) [m, s] and covariates; only covariates may have either sign. Runs and groups: constant, |v|,
// difference of the sides, v a, climb, payload times |v|, covariates, all of either sign.
struct TermColumns {
  std::vector<std::string> names, units;
  std::vector<bool> nonnegative{};  // empty: none
  Eigen::MatrixXd x;
};
TermColumns term_columns(const Data& data);

// The measured power and two models of it [W, by row] in the same terms; terms that replace each other are
// joined. Empty without battery power.
struct PowerTerms {
  std::vector<Term> terms;    // largest first
  std::vector<TermSum> sums;  // of differences of 3 standard deviations and 2 % of power
};
PowerTerms power_terms(const Fit& fit, const Eigen::VectorXd& explained_w);

}  // namespace joulecast::gap::posterior
