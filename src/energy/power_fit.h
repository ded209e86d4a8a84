#pragma once

#include <Eigen/Dense>
#include <bitset>
#include <functional>

#include "base/error.h"
#include "energy/power_parameters.h"
#include "energy/power_windows.h"

namespace joulecast::energy {

using PowerFree = std::bitset<power_parameter_count>;

// The parameters with the least residual of the battery's power, in units of PowerParameters.
struct PowerFit {
  Eigen::VectorXd x;
  Eigen::VectorXd deviation;    // standard, of every parameter that the file does not hold, fitted or not
  Eigen::MatrixXd information;  // of the data alone, correlated windows counted for less
  double inflation = 1;         // of the variance, since errors of neighbouring windows are correlated
  double spread_w = 0;          // robust, of the residuals of moving windows
};

// Huber's estimator (statistics/regression.h) with the file as prior, bounded, by damped Gauss-Newton steps
// on numerical differences (Ceres rests too early where bounds bind, as they do here more often than not).
// Resting and moving windows each have their own spread. `use`: blocks that are used; `free`: parameters that
// are fitted, the rest stays at `start`.
//
// Windows overlap, and the model's errors last longer than one window: scores are summed over blocks (Liang
// and Zeger, Biometrika 73, 1986). Data weigh against the prior by the inflation that the scores show, its
// median over parameters; a parameter's deviation is the larger of the one by this inflation and the one by
// its own scores. Parameters that are not fitted widen the others' deviations by their own uncertainty.
// Fault::invalid without windows.
Result<PowerFit> fit_power(const PowerParameters& parameters, const PowerWindows& data,
                           const std::function<bool(std::size_t block)>& use, const PowerFree& free,
                           const Eigen::VectorXd& start);

}  // namespace joulecast::energy
