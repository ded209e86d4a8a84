#include "statistics/selection.h"

#include <cmath>

#include "statistics/bootstrap.h"

namespace joulecast::statistics {
namespace {

// Under these weights of the blocks.
std::pair<std::size_t, std::size_t> choose(const Eigen::MatrixXd& score, std::span<const std::size_t> size,
                                           const Eigen::VectorXd& weight) {
  const Eigen::VectorXd total = score * weight;
  Eigen::Index best = 0;
  total.maxCoeff(&best);
  const double n = weight.sum();
  Eigen::Index chosen = best;
  for (Eigen::Index m = 0; m < score.rows(); ++m) {
    const auto at = static_cast<std::size_t>(m), now = static_cast<std::size_t>(chosen);
    if (size[at] > size[now] || (size[at] == size[now] && total[m] <= total[chosen])) continue;
    const Eigen::ArrayXd d = (score.row(best) - score.row(m)).transpose().array();
    const double mean = (d * weight.array()).sum() / n;
    const double square = ((d - mean).square() * weight.array()).sum();
    // sd of the sum of n paired differences.
    const double error = n > 1 ? std::sqrt(n / (n - 1) * square) : 0;
    if (n * mean <= error) chosen = m;
  }
  return {static_cast<std::size_t>(best), static_cast<std::size_t>(chosen)};
}

}  // namespace

Selection select_within_error(const Eigen::MatrixXd& score, std::span<const std::size_t> size) {
  Selection s;
  const auto blocks = static_cast<std::size_t>(score.cols());
  s.probability.assign(static_cast<std::size_t>(score.rows()), 0.0);
  std::tie(s.best, s.chosen) = choose(score, size, Eigen::VectorXd::Ones(score.cols()));
  if (blocks < 2) {
    s.chosen = s.best;
    s.probability[s.best] = 1;
    return s;
  }
  const auto draws = bootstrap_counts(blocks);
  for (const std::vector<int>& draw : draws) {
    Eigen::VectorXd weight(score.cols());
    for (std::size_t k = 0; k < blocks; ++k) weight[static_cast<Eigen::Index>(k)] = draw[k];
    s.probability[choose(score, size, weight).second] += 1 / static_cast<double>(draws.size());
  }
  return s;
}

}  // namespace joulecast::statistics
