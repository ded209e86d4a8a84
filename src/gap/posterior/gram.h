#pragma once

#include <array>
#include <span>
#include <vector>

#include "gap/posterior/equations.h"
#include "statistics/information.h"

namespace joulecast::gap::posterior {

using statistics::Information;

inline constexpr std::size_t factor_count = tolerance_factors.size();

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

// Gram matrices of the whitened rows over [E F Z y] of each block: the sufficient statistics of the
// posterior.
struct Grams {
  std::vector<Information> raw;  // of each block
  std::array<std::vector<Information>, factor_count>
      of_factor{};  // the same with scatter between blocks integrated out

  std::size_t blocks() const { return raw.size(); }
};

// `noise` of each channel of `equations`, in the same order.
Grams make_grams(const Equations& equations, std::span<const Noise> noise, std::size_t blocks);

// Standard deviations of the coefficients of every robot at this factor.
Eigen::VectorXd tolerances(const Equations& equations, double factor);

// Columns of effects and nuisances.
std::vector<Eigen::Index> without_functions(const Equations& equations);

// Weighted sum over blocks.
Information weighted_sum(std::span<const Information> blocks, std::span<const double> weights);

// Rows and columns `keep` of X'X and X'y.
Information subset(const Information& information, std::span<const Eigen::Index> keep);

// [E F] with tolerances and nuisances integrated out, for one factor.
struct Reduced {
  Information information;
  double log_evidence = 0;  // of no effect and no function, prior of the factor included
};
using ReducedByFactor = std::array<Reduced, factor_count>;

ReducedByFactor reduce(const Equations& equations, const Grams& grams, std::span<const double> weights);

}  // namespace joulecast::gap::posterior
