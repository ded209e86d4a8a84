#pragma once

#include <string>
#include <vector>

#include "gap/posterior/bagging.h"

namespace joulecast::gap::posterior {

// Errors on parts that were left out, one of `folds` at a time: selection and strengths are found again
// without each. Relative to mean power: mean |measured - predicted| over mean |measured|.
struct HeldOut {
  // One block, left out; errors are sums over its rows [W].
  struct Block {
    double file = 0, explanation = 0, regression = 0, size = 0;
  };
  double file = 0;         // the unchanged robot file
  double explanation = 0;  // effects and calibration
  double regression = 0;   // of power on term_columns(), or plain_terms()
  // In the channel of the function asked for, in the power that a residual stands for: the file, effects and
  // calibration, both with functions.
  double function_file = 0, function_effects = 0, function_all = 0;
  // What effects and functions remove, in the channel of battery power or motors where that is most, in
  // power; and the part of the folds in which that is less than `clear_gain`.
  double removed = 0, too_little = 0;
  double repeats_left =
      missing;  // repeated_part() of what effects and functions leave, where power has rows of its own
  // Of each effect asked for: the part of what its model removes that returns where the rest of its set is
  // found again without it; in the channel that loses most, of those in which the model removes something.
  std::vector<double> share;
  std::vector<Block> blocks;  // with rows that were left out
  bool known = false;         // enough rows in enough folds
};

// Terms of the plain regression of runs and groups, by row of power: a constant, |v|, difference of the
// sides, v a, climb, payload times |v|, covariates.
struct PlainTerms {
  std::vector<std::string> names, units;
  Eigen::MatrixXd x;
};
PlainTerms plain_terms(const Data& data);

// Its power by row, fitted to blocks with a weight.
Eigen::VectorXd plain_regression(const Data& data, std::span<const double> weights);

// What the posterior without some blocks has of all rows of power.
struct Without {
  Eigen::VectorXd explanation_w;   // by effects and calibration
  Eigen::VectorXd regression_w;    // by the plain regression
  std::vector<std::string> named;  // ids
};
// `weights` of each block; 0: left out.
Without predict_without(const Fit& fit, std::span<const double> weights);

// `with_functions` false: given that no function is present.
HeldOut hold_out(const Fit& fit, std::span<const Found> effects, std::optional<std::size_t> function,
                 bool with_functions = true);

// The part of the residual of power that neighbouring means over `repeats_s` share, over mean power: its
// root. NaN where too few are neighbours.
double repeated_part(const Data& data, const Eigen::VectorXd& residual_w);

}  // namespace joulecast::gap::posterior
