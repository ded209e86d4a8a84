#pragma once

#include <array>
#include <span>
#include <vector>

#include "gap/posterior/constants.h"
#include "gap/posterior/noise.h"
#include "statistics/information.h"

namespace joulecast::gap::posterior {

using statistics::Information;

inline constexpr std::size_t factor_count = tolerance_factors.size();

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
