#pragma once

#include <vector>

#include "gap/posterior/bagging.h"
#include "gap/posterior/terms.h"

namespace joulecast::gap::posterior {

// Errors on held-out parts: mean |measured - predicted| over mean |measured|.
struct HeldOut {
  // One held-out block; errors are sums over its rows [W].
  struct Block {
    double file = 0, explanation = 0, regression = 0, size = 0;
  };
  double file = 0;         // the unchanged robot file
  double explanation = 0;  // effects and calibration
  double regression = 0;   // of power on term_columns()
  // In the channel of the requested function, in units of power: file, effects and calibration, with
  // functions.
  double function_file = 0, function_effects = 0, function_all = 0;
  // Largest reduction by effects and functions in a channel of power; part of the folds in which it is small.
  double removed = 0, too_little = 0;
  double repeats_left = missing;  // repeated_part() where power has rows of its own
  // Of each requested effect: the part of its set's reduction that returns without it, formula (6).
  std::vector<double> share;
  std::vector<Block> blocks;    // with rows that were left out
  Eigen::VectorXd explained_w;  // by row of power, left out; NaN: it was not
  bool known = false;           // enough rows in enough folds
};

// 95 % interval of the part of the file's error that the explanation removes; NaN of fewer than two blocks.
std::array<double, 2> removed_interval(std::span<const HeldOut::Block> blocks);
// Part of the resamples of the blocks in which the explanation has a smaller error than the file.
double chance_of_benefit(std::span<const HeldOut::Block> blocks);

// Returns the power of the linear regression on these terms by row, fitted to blocks with a weight.
Eigen::VectorXd plain_regression(const Data& data, const TermColumns& terms, std::span<const double> weights);

// Strengths of the effects with the calibration, averaged over the models without a function.
Eigen::VectorXd mean_strengths(const Fit& fit, std::span<const double> weights);

// `with_functions` false: given that no function is present.
HeldOut hold_out(const Fit& fit, std::span<const Found> effects, std::optional<std::size_t> function,
                 bool with_functions = true);

// What repeats of a residual of power, over mean power. NaN with too few neighbours.
double repeated_part(const Data& data, const Eigen::VectorXd& residual_w);

}  // namespace joulecast::gap::posterior
