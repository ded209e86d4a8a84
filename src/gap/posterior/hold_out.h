#pragma once

#include <string>
#include <vector>

#include "gap/posterior/bagging.h"

namespace joulecast::gap::posterior {

// Errors on held-out parts, one of `folds` at a time: selection and strengths are re-estimated without each.
// Relative to mean power: mean |measured - predicted| over mean |measured|.
struct HeldOut {
  // One held-out block; errors are sums over its rows [W].
  struct Block {
    double file = 0, explanation = 0, regression = 0, size = 0;
  };
  double file = 0;         // the unchanged robot file
  double explanation = 0;  // effects and calibration
  double regression = 0;   // of power on term_columns(), or plain_terms()
  // In the channel of the requested function, in the power that corresponds to a residual: the file, effects
  // and calibration, both with functions.
  double function_file = 0, function_effects = 0, function_all = 0;
  // Reduction by effects and functions, in the channel of battery power or motors with the largest one, in
  // power; and the part of the folds in which it is less than `clear_gain`.
  double removed = 0, too_little = 0;
  double repeats_left =
      missing;  // repeated_part() of the residual of effects and functions, where power has rows of its own
  // Of each requested effect: the part of its model's reduction that returns where the rest of its set is
  // re-estimated without it; in the channel with the largest loss, of those in which the model reduces the
  // error.
  std::vector<double> share;
  std::vector<Block> blocks;  // with rows that were left out
  bool known = false;         // enough rows in enough folds
};

// 95 % interval of the part of the file's error that the explanation removes, by resampled blocks; NaN of
// fewer than two.
std::array<double, 2> removed_interval(std::span<const HeldOut::Block> blocks);

// Terms of the linear regression of runs and groups, by row of power: a constant, |v|, difference of the
// sides, v a, climb, payload times |v|, covariates.
struct PlainTerms {
  std::vector<std::string> names, units;
  Eigen::MatrixXd x;
};
PlainTerms plain_terms(const Data& data);

// Returns the power of the linear regression by row, fitted to blocks with a weight.
Eigen::VectorXd plain_regression(const Data& data, std::span<const double> weights);

// Strengths of the effects with the calibration, averaged over the models without a function; blocks by these
// weights.
Eigen::VectorXd mean_strengths(const Fit& fit, std::span<const double> weights);

// Predictions of the posterior without some blocks, for all rows of power.
struct Without {
  Eigen::VectorXd explanation_w;   // by effects and calibration
  Eigen::VectorXd regression_w;    // by the linear regression
  std::vector<std::string> named;  // ids
};
// `weights` of each block; 0: left out.
Without predict_without(const Fit& fit, std::span<const double> weights);

// `with_functions` false: given that no function is present.
HeldOut hold_out(const Fit& fit, std::span<const Found> effects, std::optional<std::size_t> function,
                 bool with_functions = true);

// The part of the residual of power that neighbouring means over `repeats_s` share, over mean power: its
// root. NaN with too few neighbours.
double repeated_part(const Data& data, const Eigen::VectorXd& residual_w);

}  // namespace joulecast::gap::posterior
