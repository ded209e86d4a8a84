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

using Indices = std::vector<Eigen::Index>;

// The sums of a block for some terms and, last, for the fitted quantity.
constexpr int most_terms = 5;
using Sums = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_terms + 1, most_terms + 1>;
using Terms = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most_terms + 1, 1>;

// Least squares; terms that are 0 in all blocks get the coefficient 0. Empty where the others
// cannot be distinguished.
std::optional<Terms> solve(const Sums& sums, const Terms& zero) {
  const Eigen::Index n = zero.size();
  const Terms unit = (sums.diagonal().head(n) + zero).cwiseSqrt().cwiseInverse();
  Sums scaled = sums.topLeftCorner(n, n);
  scaled.diagonal() += zero;
  scaled = unit.asDiagonal() * scaled * unit.asDiagonal();
  const Eigen::LDLT<Sums> factor(scaled);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > least_part)) return std::nullopt;
  return unit.cwiseProduct(factor.solve(unit.cwiseProduct(sums.col(n).head(n))));
}

}  // namespace

void Products::Block::join(const Block& other) {
  rows += other.rows;
  sums += other.sums;
  noise += other.noise;
}

void Products::add(std::initializer_list<double> row,
                   std::initializer_list<std::initializer_list<double>> noise) {
  using Values = Eigen::Map<const Eigen::VectorXd>;
  const Values z(row.begin(), static_cast<Eigen::Index>(row.size()));
  if (!z.allFinite()) return;
  if (open_.rows == 0) open_.sums = open_.noise = Eigen::MatrixXd::Zero(z.size(), z.size());
  for (const auto& part : noise) {
    const Values e(part.begin(), z.size());
    if (e.allFinite()) open_.noise.noalias() += e * e.transpose();
  }
  open_.sums.noalias() += z * z.transpose();
  open_.rows += 1;
}

void Products::next_block() {
  if (++waited_ < stride_) return;
  finish();
  if (blocks_.size() < max_product_blocks) return;
  halve(blocks_);
  stride_ *= 2;
}

void Products::finish() {
  waited_ = 0;
  if (open_.rows > 0) blocks_.push_back(std::exchange(open_, {}));
}

std::vector<Products::Block> with_part_of(std::vector<Products::Block> blocks, Eigen::Index k, Eigen::Index j,
                                          double factor) {
  for (Products::Block& block : blocks) {
    Eigen::MatrixXd change = Eigen::MatrixXd::Identity(block.sums.rows(), block.sums.rows());
    change(k, j) += factor;
    for (Eigen::MatrixXd* of : {&block.sums, &block.noise}) *of = change * *of * change.transpose();
  }
  return blocks;
}

double BlockFit::sd(Eigen::Index k) const {
  return std::sqrt(std::max(covariance(k, k), 0.0));
}

BlockFit fit_blocks(std::span<const Products::Block> blocks, Eigen::Index y, const Indices& x) {
  const auto n = static_cast<Eigen::Index>(x.size());
  Indices used = x;
  used.push_back(y);
  std::vector<Sums> sums, clean;
  Terms all = Terms::Zero(n);
  for (const Products::Block& block : blocks) {
    sums.emplace_back(block.sums(used, used));
    clean.emplace_back(sums.back() - block.noise(used, used));
    all += sums.back().diagonal().head(n);
  }
  const Terms zero = all.unaryExpr([](double sum) { return sum > 0 ? 0.0 : 1.0; });
  BlockFit fit;
  const double freedom = static_cast<double>(blocks.size()) - (static_cast<double>(n) - zero.sum());
  if (!(freedom > 0) || zero.sum() == static_cast<double>(n)) return fit;
  std::vector<double> weight(blocks.size(), 1.0);
  Sums total;
  for (int round = 1;; ++round) {
    total = Sums::Zero(n + 1, n + 1);
    for (std::size_t k = 0; k < blocks.size(); ++k) total += weight[k] * clean[k];
    const auto solved = solve(total, zero);
    if (!solved) return fit;
    fit.coefficient = *solved;
    if (round == rounds) break;
    Terms rest(n + 1);
    rest << -*solved, 1;
    std::vector<double> misfits;
    for (std::size_t k = 0; k < blocks.size(); ++k)
      misfits.push_back(std::sqrt(std::max(rest.dot(sums[k] * rest), 0.0) / blocks[k].rows));
    const double usual = statistics::median(misfits);
    for (std::size_t k = 0; k < blocks.size() && usual > 0; ++k)
      weight[k] = statistics::huber_weight(misfits[k], usual, misfit_bound);
  }
  fit.covariance = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const auto without = solve(total - weight[k] * clean[k], zero);
    if (!without) return fit;  // one block alone distinguishes the terms
    const Terms change = *without - fit.coefficient;
    fit.covariance += change * change.transpose();
  }
  fit.covariance *= (static_cast<double>(blocks.size()) - 1) / static_cast<double>(blocks.size());
  // A quantity that is 0 throughout leaves only its own coefficient unidentified.
  for (Eigen::Index k = 0; k < n; ++k)
    if (zero[k] != 0) fit.covariance(k, k) = std::numeric_limits<double>::infinity();
  fit.freedom = freedom;
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
  Indices used;  // a coefficient without a part in it may be unknown
  for (Eigen::Index k = 0; k < combination.size(); ++k)
    if (combination[k] != 0) used.push_back(k);
  const Eigen::VectorXd part = combination(used);
  const double variance = part.dot(fit.covariance(used, used) * part);
  return {combination.dot(fit.coefficient), std::sqrt(std::max(variance, 0.0)), fit.freedom};
}

Estimate estimate(const BlockFit& fit, Eigen::Index coefficient) {
  if (!fit.known()) return {};
  return {fit.coefficient[coefficient], fit.sd(coefficient), fit.freedom};
}

Estimate operator*(const Estimate& e, double factor) {
  return {e.value * factor, e.sd * std::fabs(factor), e.freedom};
}

Estimate ratio_of_sums(std::span<const Products::Block> blocks, Eigen::Index y, Eigen::Index x,
                       Eigen::Index one) {
  if (blocks.size() < 2) return {};
  double sum_y = 0, sum_x = 0, square = 0;
  for (const auto& block : blocks) sum_y += block.sums(one, y), sum_x += block.sums(one, x);
  if (sum_x == 0) return {};
  const double ratio = sum_y / sum_x, n = static_cast<double>(blocks.size());
  for (const auto& block : blocks) square += std::pow(block.sums(one, y) - ratio * block.sums(one, x), 2);
  return {ratio, std::sqrt(square * n / (n - 1)) / std::fabs(sum_x), n - 1};
}

}  // namespace joulecast::plausibility
