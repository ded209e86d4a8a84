#include "statistics/regression.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "statistics/robust.h"

namespace joulecast::statistics {
namespace {

constexpr int most_rounds = 50;
constexpr double settled = 1e-6;
constexpr double least_part = 1e-10;  // of the largest eigenvalue: smaller ones count as zero

// The generalised inverse of a symmetric matrix.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
  const double least = least_part * std::max(eigen.eigenvalues().maxCoeff(), 1e-300);
  const Eigen::VectorXd d = eigen.eigenvalues().unaryExpr([&](double v) { return v > least ? 1 / v : 0.0; });
  return eigen.eigenvectors() * d.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

Eigen::VectorXd huber_weights(const Eigen::VectorXd& residual, double spread) {
  constexpr double bound = 1.345;
  return residual.unaryExpr([&](double v) { return huber_weight(v, spread, bound); });
}

Eigen::VectorXd signed_solution(const Eigen::MatrixXd& xx, const Eigen::VectorXd& xy,
                                const std::vector<bool>& nonnegative) {
  const Eigen::Index p = xx.rows();
  const Eigen::VectorXd unit = xx.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0; });
  const Eigen::MatrixXd a = unit.asDiagonal() * xx * unit.asDiagonal();
  const Eigen::VectorXd c = unit.cwiseProduct(xy);
  const auto free = [&](Eigen::Index k) { return !nonnegative[static_cast<std::size_t>(k)]; };
  std::vector<bool> moves(nonnegative.size());
  const auto solve = [&] {
    std::vector<Eigen::Index> own;
    for (Eigen::Index k = 0; k < p; ++k)
      if (moves[static_cast<std::size_t>(k)]) own.push_back(k);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(p);
    if (!own.empty()) b(own) = inverse(a(own, own)) * c(own);
    return b;
  };
  for (Eigen::Index k = 0; k < p; ++k) moves[static_cast<std::size_t>(k)] = free(k);
  Eigen::VectorXd b = solve();
  const double least = 1e-10 * c.norm();
  for (Eigen::Index added = 0; added < 3 * p; ++added) {
    const Eigen::VectorXd gain = c - a * b;
    Eigen::Index next = -1;
    for (Eigen::Index k = 0; k < p; ++k)
      if (!moves[static_cast<std::size_t>(k)] && gain[k] > (next < 0 ? least : gain[next])) next = k;
    if (next < 0) break;
    moves[static_cast<std::size_t>(next)] = true;
    for (Eigen::VectorXd target = solve();; target = solve()) {
      double step = 1;
      Eigen::Index first = -1;
      for (Eigen::Index k = 0; k < p; ++k) {
        if (free(k) || target[k] > 0 || !moves[static_cast<std::size_t>(k)]) continue;
        const double to_zero = b[k] > 0 ? b[k] / (b[k] - target[k]) : 0;
        if (to_zero < step || first < 0) step = to_zero, first = k;
      }
      b += step * (target - b);
      if (first < 0) break;
      moves[static_cast<std::size_t>(first)] = false;
      b[first] = 0;
    }
  }
  return unit.cwiseProduct(b);
}

Eigen::MatrixXd block_sums(const Eigen::MatrixXd& rows, const std::vector<std::size_t>& block) {
  std::map<std::size_t, std::vector<Eigen::Index>> of_block;
  for (std::size_t k = 0; k < block.size(); ++k) of_block[block[k]].push_back(static_cast<Eigen::Index>(k));
  Eigen::MatrixXd sums(static_cast<Eigen::Index>(of_block.size()), rows.cols());
  for (Eigen::Index next = 0; const auto& [number, own] : of_block)
    sums.row(next++) = rows(own, Eigen::all).colwise().sum();
  return sums;
}

Regression robust_regression(const Eigen::MatrixXd& x, const Eigen::VectorXd& y,
                             const std::vector<std::size_t>& block, const std::vector<bool>& nonnegative) {
  const Eigen::Index n = x.rows(), p = x.cols();
  Regression r;
  r.coefficients = r.sd = Eigen::VectorXd::Zero(p);
  if (n == 0) return r;
  const Eigen::VectorXd size =
      (x.colwise().norm() / std::sqrt(static_cast<double>(n))).transpose().unaryExpr([](double v) {
        return v > 0 ? 1 / v : 0.0;
      });
  const Eigen::MatrixXd scaled = x * size.asDiagonal();
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(n), e = y, b = Eigen::VectorXd::Zero(p);
  for (int round = 0; round < most_rounds; ++round) {
    const Eigen::MatrixXd weighted = weight.asDiagonal() * scaled;
    const Eigen::VectorXd before = b;
    const Eigen::MatrixXd xx = weighted.transpose() * scaled;
    const Eigen::VectorXd xy = weighted.transpose() * y;
    b = nonnegative.empty() ? Eigen::VectorXd(inverse(xx) * xy) : signed_solution(xx, xy, nonnegative);
    e = y - scaled * b;
    r.spread = spread_about_zero({e.data(), static_cast<std::size_t>(n)});
    if (!(r.spread > 0) || (b - before).norm() <= settled * b.norm()) break;
    weight = huber_weights(e, r.spread);
  }
  // Huber's sandwich, section 7.6; scores summed over blocks: Liang and Zeger 1986.
  Eigen::MatrixXd scores = weight.cwiseProduct(e).asDiagonal() * scaled;
  const bool one_block = std::ranges::adjacent_find(block, std::ranges::not_equal_to()) == block.end();
  if (!one_block) scores = block_sums(scores, block);
  const auto blocks = static_cast<double>(scores.rows());
  const double few = blocks > 1 ? blocks / (blocks - 1) : 1.0;
  const Eigen::VectorXd inside = weight.unaryExpr([](double w) { return w < 1 ? 0.0 : 1.0; });
  const Eigen::MatrixXd bread = inverse(scaled.transpose() * inside.asDiagonal() * scaled);
  r.sd = (std::sqrt(few) * (scores * bread).colwise().norm()).transpose().cwiseProduct(size);
  r.coefficients = size.asDiagonal() * b;
  r.weight = weight;
  return r;
}

}  // namespace joulecast::statistics
