#pragma once

#include "gap/posterior/equations.h"

namespace joulecast::gap::posterior {

// The errors of the rows of one channel.
struct Noise {
  Eigen::VectorXd weight;  // of each row: inverse variance, less for outliers, over the inflation
  double inflation = 1;    // of the variance: ratio of the scatter of blocks' scores to that of single rows
  double sigma = 0;        // median spread of a row, in the channel's unit; 0: the channel is no measurement
  double rest = 0;         // mean |residual| of the fit of all columns, in the channel's unit
};

// Estimated from the residuals of a ridge fit of all columns.
Noise learn_noise(const ChannelRows& rows, const Equations& equations,
                  const std::vector<Function>& functions);

}  // namespace joulecast::gap::posterior
