#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <vector>

namespace joulecast::statistics {

// The smallest model that predicts as well as any, within one standard error (Breiman and others, Classification
// and Regression Trees, 1984, section 3.4.3; errors paired by block).
struct Selection {
  std::size_t best = 0;             // highest mean score
  std::size_t chosen = 0;           // the smallest within one standard error of it; of those, the best
  std::vector<double> probability;  // of each model to be chosen, over a bootstrap of blocks
};

// `score`: models by blocks, log predictive density of each block by a fit without it; `size` of each model.
// At least one model; with fewer than two blocks the best model is chosen.
Selection select_within_error(const Eigen::MatrixXd& score, std::span<const std::size_t> size);

}  // namespace joulecast::statistics
