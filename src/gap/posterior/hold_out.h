#pragma once

#include <string>
#include <vector>

#include "gap/posterior/bagging.h"

namespace joulecast::gap::posterior {

// Errors on parts that were left out, one of `folds` at a time: selection and strengths are found again
// without each. Relative to mean power: mean |measured - predicted| over mean |measured|.
struct HeldOut {
  double file = 0;         // the unchanged robot file
  double explanation = 0;  // effects and calibration
  double regression = 0;   // of power on term_columns()
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
  bool known = false;  // enough rows in enough folds
};

HeldOut hold_out(const Fit& fit, std::span<const Found> effects, std::optional<std::size_t> function);

// The part of the residual of power that neighbouring means over `repeats_s` share, over mean power: its
// root. NaN where too few are neighbours.
double repeated_part(const Data& data, const Eigen::VectorXd& residual_w);

}  // namespace joulecast::gap::posterior
