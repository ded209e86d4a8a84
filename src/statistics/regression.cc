#include "statistics/regression.h"

#include <algorithm>
#include <cmath>

#include "statistics/robust.h"

namespace joulecast::statistics {
namespace {

constexpr double bound = 1.345;  // 95 % efficient on normal errors, Huber and Ronchetti, section 7.8
constexpr int most_rounds = 50;
constexpr double settled = 1e-6;
constexpr double least_part = 1e-10;  // of the largest eigenvalue: what is below is not in the data

// The generalised inverse of a symmetric matrix.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
  const double least = least_part * std::max(eigen.eigenvalues().maxCoeff(), 1e-300);
  const Eigen::VectorXd d = eigen.eigenvalues().unaryExpr([&](double v) { return v > least ? 1 / v : 0.0; });
  return eigen.eigenvectors() * d.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

Regression robust_regression(const Eigen::MatrixXd& x, const Eigen::VectorXd& y,
                             const std::vector<std::size_t>& block) {
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
  Eigen::MatrixXd covariance;
  for (int round = 0; round < most_rounds; ++round) {
    const Eigen::MatrixXd weighted = weight.asDiagonal() * scaled;
    covariance = inverse(weighted.transpose() * scaled);
    const Eigen::VectorXd before = b;
    b = covariance * (weighted.transpose() * y);
    e = y - scaled * b;
    r.spread = spread_about_zero({e.data(), static_cast<std::size_t>(n)});
    if (!(r.spread > 0) || (b - before).norm() <= settled * b.norm()) break;
    for (Eigen::Index k = 0; k < n; ++k) weight[k] = huber_weight(e[k], r.spread, bound);
  }
  // Sandwich over blocks: Liang and Zeger 1986.
  Eigen::MatrixXd middle = Eigen::MatrixXd::Zero(p, p);
  Eigen::VectorXd score = Eigen::VectorXd::Zero(p);
  std::size_t blocks = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    score += weight[k] * e[k] * scaled.row(k).transpose();
    const auto at = static_cast<std::size_t>(k);
    if (k + 1 < n && block[at + 1] == block[at]) continue;
    middle += score * score.transpose();
    score.setZero();
    ++blocks;
  }
  const double few = blocks > 1 ? static_cast<double>(blocks) / static_cast<double>(blocks - 1) : 1.0;
  r.sd = (few * (covariance * middle * covariance).diagonal()).cwiseMax(0.0).cwiseSqrt().cwiseProduct(size);
  r.coefficients = size.asDiagonal() * b;
  return r;
}

}  // namespace joulecast::statistics
