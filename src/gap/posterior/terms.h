#pragma once

#include <string>
#include <vector>

#include "gap/posterior/walk.h"

namespace joulecast::gap::posterior {

// A term of battery power in one robust regression: its coefficients in the readings and in the model.
struct Term {
  std::string name;  // constant, |v|, v^2, v^3, turning, v a, v climb, a covariate; joined ones with " + "
  std::string unit;  // W per unit of the term; of joined terms W, at the mean motion
  double data = 0;   // of the measured power
  double model = 0;  // of the power that the robot file predicts
  double explained = 0;                      // of the power that effects and calibration predict
  double deviation = 0;                      // of `data`, one standard deviation by resampled blocks
  double difference_w = 0, deviation_w = 0;  // data - model at the mean size of the term
};

// A difference that is certain although its cause is not: several effects have its form.
struct Sum {
  std::string terms;                         // as a Term's name
  double difference_w = 0, deviation_w = 0;  // measured - predicted by the file, at the mean motion
  std::vector<std::string> effects;  // ids of effects with a power that these terms reproduce, closest first
  // The parameter of the robot file that takes all of it within `equivalent` of the power, with the value
  // then; its name contains the unit. Empty: no such parameter.
  std::string parameter;
  double value = missing, deviation = missing;
  std::optional<dynamics::ActiveEffect> change{};  // of the file, by which the parameter takes it
};

// The regressors of the referee, by row of power: constant, |v|, v^2, v^3, half the difference of the sides,
// v a, v sin(climb) [m, s] and covariates. Only covariates may have either sign.
struct TermColumns {
  std::vector<std::string> names, units;
  std::vector<bool> nonnegative;
  Eigen::MatrixXd x;
};
TermColumns term_columns(const Data& data);

// The measured power and two models of it [W, by row] in the same terms; terms that replace each other are
// joined. Empty without battery power.
struct PowerTerms {
  std::vector<Term> terms;  // largest first
  std::vector<Sum> sums;    // of differences of 3 standard deviations and 2 % of power
};
PowerTerms power_terms(const Fit& fit, const Eigen::VectorXd& explained_w);

}  // namespace joulecast::gap::posterior
