#include "plausibility/products.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "statistics/distributions.h"
#include "statistics/robust.h"

namespace joulecast::plausibility {
namespace {

constexpr std::size_t max_product_blocks = 64;
constexpr int rounds = 12;
constexpr double misfit_bound = 2.5;  // median misfits, beyond which a block is downweighted
constexpr double least_part = 1e-9;   // of a quantity's own square; less is collinear with the others
constexpr double one_sided = 0.9995;  // one-sided quantile for 99.9 %

double misfit(const Products::Block& block, std::size_t y, std::span<const std::size_t> x,
              const Eigen::VectorXd& b) {
  const auto at = [&](std::size_t i, std::size_t k) {
    return block.sums(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
  };
  double sum = at(y, y);
  for (std::size_t i = 0; i < x.size(); ++i) {
    sum -= 2 * b[static_cast<Eigen::Index>(i)] * at(y, x[i]);
    for (std::size_t k = 0; k < x.size(); ++k) {
      sum += b[static_cast<Eigen::Index>(i)] * b[static_cast<Eigen::Index>(k)] * at(x[i], x[k]);
    }
  }
  return std::sqrt(std::max(sum, 0.0) / block.rows);
}

struct Normal {  // normal equations of one block
  Eigen::MatrixXd xx;
  Eigen::VectorXd xy;
};

Normal normal_of(const Products::Block& block, std::size_t y, std::span<const std::size_t> x) {
  const auto n = static_cast<Eigen::Index>(x.size());
  Normal normal{Eigen::MatrixXd(n, n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto row = static_cast<Eigen::Index>(x[static_cast<std::size_t>(i)]);
    normal.xy[i] = block.sums(row, static_cast<Eigen::Index>(y));
    for (Eigen::Index k = 0; k < n; ++k) {
      normal.xx(i, k) = block.sums(row, static_cast<Eigen::Index>(x[static_cast<std::size_t>(k)]));
    }
  }
  return normal;
}

}  // namespace

Products::Block Products::empty(std::size_t quantities) {
  const auto n = static_cast<Eigen::Index>(quantities);
  return {0, Eigen::MatrixXd::Zero(n, n)};
}

void Products::add(std::initializer_list<double> row) {
  const Eigen::Map<const Eigen::VectorXd> z(row.begin(), static_cast<Eigen::Index>(row.size()));
  if (!z.allFinite()) return;
  open_.sums.noalias() += z * z.transpose();
  open_.rows += 1;
}

void Products::next_block() {
  if (++waited_ < stride_) return;
  finish();
  if (blocks_.size() < max_product_blocks) return;
  for (std::size_t k = 0; 2 * k + 1 < blocks_.size(); ++k) {
    if (k > 0) blocks_[k] = std::move(blocks_[2 * k]);
    blocks_[k].rows += blocks_[2 * k + 1].rows;
    blocks_[k].sums += blocks_[2 * k + 1].sums;
  }
  blocks_.resize(blocks_.size() / 2);
  stride_ *= 2;
}

void Products::finish() {
  waited_ = 0;
  if (open_.rows == 0) return;
  Block next = empty(static_cast<std::size_t>(open_.sums.rows()));
  blocks_.push_back(std::exchange(open_, std::move(next)));
}

std::vector<Products::Block> with_part_of(std::vector<Products::Block> blocks, std::size_t k, std::size_t j,
                                          double factor) {
  if (blocks.empty()) return blocks;
  const Eigen::Index n = blocks.front().sums.rows();
  Eigen::MatrixXd change = Eigen::MatrixXd::Identity(n, n);
  change(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) += factor;
  for (Products::Block& block : blocks) block.sums = change * block.sums * change.transpose();
  return blocks;
}

double BlockFit::sd(Eigen::Index k) const {
  return std::sqrt(std::max(covariance(k, k), 0.0));
}

namespace {

// Weighted least squares; empty where the terms cannot be distinguished.
std::optional<Eigen::VectorXd> solve(const Eigen::MatrixXd& xx, const Eigen::VectorXd& xy) {
  const Eigen::VectorXd unit = xx.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factor(unit.asDiagonal() * xx * unit.asDiagonal());
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > least_part)) return std::nullopt;
  return unit.asDiagonal() * factor.solve(unit.asDiagonal() * xy);
}

BlockFit fit_terms(std::span<const Products::Block> blocks, std::size_t y, std::span<const std::size_t> x) {
  const auto n = static_cast<Eigen::Index>(x.size());
  BlockFit fit;
  const double freedom = static_cast<double>(blocks.size()) - static_cast<double>(x.size());
  if (!(freedom > 0)) return fit;
  std::vector<Normal> normals;
  normals.reserve(blocks.size());
  for (const Products::Block& block : blocks) normals.push_back(normal_of(block, y, x));
  std::vector<double> weight(blocks.size(), 1.0);
  Eigen::MatrixXd xx;
  Eigen::VectorXd xy;
  for (int round = 1;; ++round) {
    xx = Eigen::MatrixXd::Zero(n, n);
    xy = Eigen::VectorXd::Zero(n);
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      xx += weight[k] * normals[k].xx;
      xy += weight[k] * normals[k].xy;
    }
    const auto solved = solve(xx, xy);
    if (!solved) return fit;
    fit.coefficient = *solved;
    if (round == rounds) break;
    std::vector<double> misfits;
    misfits.reserve(blocks.size());
    for (const Products::Block& block : blocks) misfits.push_back(misfit(block, y, x, fit.coefficient));
    const double usual = statistics::median(misfits);
    for (std::size_t k = 0; k < blocks.size() && usual > 0; ++k) {
      weight[k] = statistics::huber_weight(misfits[k], usual, misfit_bound);
    }
  }
  fit.covariance = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const auto without = solve(xx - weight[k] * normals[k].xx, xy - weight[k] * normals[k].xy);
    if (!without) return fit;  // one block alone distinguishes the terms
    const Eigen::VectorXd change = *without - fit.coefficient;
    fit.covariance += change * change.transpose();
  }
  fit.covariance *= (static_cast<double>(blocks.size()) - 1) / static_cast<double>(blocks.size());
  fit.freedom = freedom;
  return fit;
}

}  // namespace

BlockFit fit_blocks(std::span<const Products::Block> blocks, std::size_t y, std::span<const std::size_t> x) {
  // A quantity that is 0 throughout leaves only its own coefficient unidentified.
  std::vector<std::size_t> terms;
  std::vector<Eigen::Index> place;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(x[k]);
    if (std::ranges::none_of(blocks, [&](const auto& block) { return block.sums(at, at) > 0; })) continue;
    terms.push_back(x[k]);
    place.push_back(static_cast<Eigen::Index>(k));
  }
  BlockFit some = terms.empty() ? BlockFit{} : fit_terms(blocks, y, terms);
  if (!some.known() || terms.size() == x.size()) return some;
  const auto n = static_cast<Eigen::Index>(x.size());
  BlockFit fit{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n), some.freedom};
  fit.covariance.diagonal().setConstant(std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < place.size(); ++i) {
    fit.coefficient[place[i]] = some.coefficient[static_cast<Eigen::Index>(i)];
    for (std::size_t k = 0; k < place.size(); ++k) {
      fit.covariance(place[i], place[k]) =
          some.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
    }
  }
  return fit;
}

bool Estimate::known() const {
  return freedom > 0 && std::isfinite(value) && std::isfinite(sd);
}

std::array<double, 2> Estimate::interval() const {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  if (!known()) return {nan, nan};
  const double t = statistics::student_t_quantile(0.975, freedom);
  return {value - t * sd, value + t * sd};
}

bool Estimate::sure() const {
  return known() && std::fabs(value) > statistics::student_t_quantile(one_sided, freedom) * sd;
}

Estimate estimate(const BlockFit& fit, const Eigen::VectorXd& combination) {
  if (!fit.known()) return {};
  double variance = 0;
  for (Eigen::Index i = 0; i < combination.size(); ++i) {
    for (Eigen::Index k = 0; k < combination.size(); ++k) {
      if (combination[i] * combination[k] != 0)
        variance += combination[i] * combination[k] * fit.covariance(i, k);
    }
  }
  return {combination.dot(fit.coefficient), std::sqrt(std::max(variance, 0.0)), fit.freedom};
}

Estimate estimate(const BlockFit& fit, Eigen::Index coefficient) {
  if (!fit.known()) return {};
  return {fit.coefficient[coefficient], fit.sd(coefficient), fit.freedom};
}

Estimate operator*(const Estimate& e, double factor) {
  return {e.value * factor, e.sd * std::fabs(factor), e.freedom};
}

Estimate ratio_of_sums(std::span<const Products::Block> blocks, std::size_t y, std::size_t x,
                       std::size_t one) {
  if (blocks.size() < 2) return {};
  const auto at = [&](const Products::Block& block, std::size_t k) {
    return block.sums(static_cast<Eigen::Index>(one), static_cast<Eigen::Index>(k));
  };
  double sum_y = 0, sum_x = 0, square = 0;
  for (const auto& block : blocks) sum_y += at(block, y), sum_x += at(block, x);
  if (sum_x == 0) return {};
  const double ratio = sum_y / sum_x, n = static_cast<double>(blocks.size());
  for (const auto& block : blocks) square += std::pow(at(block, y) - ratio * at(block, x), 2);
  return {ratio, std::sqrt(square * n / (n - 1)) / std::fabs(sum_x), n - 1};
}

}  // namespace joulecast::plausibility
