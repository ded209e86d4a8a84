#include "statistics/evidence.h"

#include <algorithm>
#include <cmath>

#include "statistics/distributions.h"

namespace joulecast::statistics {
namespace {

constexpr double impossible = -1e300;

bool bounded(const Candidate& c) {
  return std::isfinite(c.least) || std::isfinite(c.most);
}

}  // namespace

Evidence::Evidence(const Information& data, const Eigen::VectorXd& tolerance,
                   std::span<const std::size_t> selected)
    : place_(static_cast<std::size_t>(data.xx.rows()), -1) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0; k < data.xx.rows(); ++k) {
    if (!selected.empty() && !std::ranges::binary_search(selected, static_cast<std::size_t>(k))) continue;
    place_[static_cast<std::size_t>(k)] = static_cast<Eigen::Index>(kept.size());
    kept.push_back(k);
  }
  Eigen::MatrixXd a = tolerance.asDiagonal() * data.xx * tolerance.asDiagonal();
  a.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  // L^-1 T X'X and L^-1 T X'y, so that the subtracted matrix is exactly symmetric.
  Eigen::MatrixXd solved = tolerance.asDiagonal() * data.xx(Eigen::all, kept);
  factor.matrixL().solveInPlace(solved);
  const Eigen::VectorXd solved_y = factor.matrixL().solve(tolerance.asDiagonal() * data.xy);
  xx_ = data.xx(kept, kept);
  if (solved.size() > 0) xx_.triangularView<Eigen::Lower>() -= solved.transpose() * solved;
  xx_.triangularView<Eigen::StrictlyUpper>() = xx_.transpose();
  xy_ = data.xy(kept) - solved.transpose() * solved_y;
  for (Eigen::Index k = 0; k < xx_.rows(); ++k) xx_(k, k) = std::max(0.0, xx_(k, k));
  log_density_ = data.log_scale - 0.5 * (data.yy - solved_y.squaredNorm()) -
                 factor.matrixLLT().diagonal().array().log().sum();
}

bool Evidence::solve(std::span<const Candidate* const> set, Posterior& posterior) const {
  std::vector<Eigen::Index> index;
  std::vector<double> unit;
  for (const Candidate* c : set) {
    for (const std::size_t k : c->columns) {
      index.push_back(place_[k]);
      unit.push_back(c->expected);
    }
  }
  const Eigen::Map<const Eigen::VectorXd> scale(unit.data(), static_cast<Eigen::Index>(unit.size()));
  Eigen::MatrixXd a = scale.asDiagonal() * xx_(index, index) * scale.asDiagonal();
  a.diagonal().array() += 1.0;
  posterior.b = scale.asDiagonal() * xy_(index);
  posterior.factor.compute(a);
  if (posterior.factor.info() != Eigen::Success) return false;
  posterior.mean = posterior.factor.solve(posterior.b);
  return true;
}

double Evidence::log_odds(std::span<const Candidate* const> set) const {
  if (set.empty()) return 0;
  Posterior p;
  if (!solve(set, p)) return impossible;
  const Eigen::Index n = p.mean.size();
  double result = 0.5 * p.b.dot(p.mean) - p.factor.matrixLLT().diagonal().array().log().sum();
  // Each variance separately: mostly few of the coefficients are bounded.
  const auto sd = [&](Eigen::Index k) {
    Eigen::VectorXd column = Eigen::VectorXd::Unit(n, k);
    p.factor.matrixL().solveInPlace(column);
    return column.norm();
  };
  Eigen::Index at = 0;
  for (const Candidate* c : set) {
    result += c->log_prior;
    if (!bounded(*c)) {
      at += static_cast<Eigen::Index>(c->columns.size());
      continue;
    }
    const double least = c->least / c->expected, most = c->most / c->expected;
    for (std::size_t k = 0; k < c->columns.size(); ++k, ++at) {
      result += log_normal_within(p.mean[at], sd(at), least, most) - log_normal_within(0, 1, least, most);
    }
  }
  return result;
}

Evidence::Estimate Evidence::estimate(std::span<const Candidate* const> set) const {
  Estimate e;
  Posterior p;
  if (set.empty() || !solve(set, p)) return e;
  const Eigen::Index n = p.mean.size();
  Eigen::VectorXd unit(n);
  Eigen::Index at = 0;
  for (const Candidate* c : set) {
    for (std::size_t k = 0; k < c->columns.size(); ++k) unit[at++] = c->expected;
  }
  e.covariance = unit.asDiagonal() * p.factor.solve(Eigen::MatrixXd::Identity(n, n)) * unit.asDiagonal();
  e.mean = unit.asDiagonal() * p.mean;
  e.sd = e.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  at = 0;
  for (const Candidate* c : set) {
    for (std::size_t k = 0; k < c->columns.size(); ++k, ++at)
      e.mean[at] = std::clamp(e.mean[at], c->least, c->most);
  }
  return e;
}

double Evidence::separation(std::size_t column, double strength, std::size_t other, double expected) const {
  const Eigen::Index i = place_[column], j = place_[other];
  const double followed = xx_(i, j) * xx_(i, j) / (xx_(j, j) + 1 / (expected * expected));
  return 0.5 * strength * strength * std::max(0.0, xx_(i, i) - followed);
}

Ridge ridge(const Information& data, const Eigen::VectorXd& sd) {
  const Eigen::Index p = data.xx.rows();
  Eigen::MatrixXd a = sd.asDiagonal() * data.xx * sd.asDiagonal();
  a.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  Ridge r;
  r.mean = sd.asDiagonal() * factor.solve(sd.asDiagonal() * data.xy);
  r.covariance = sd.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(p, p)) * sd.asDiagonal();
  return r;
}

}  // namespace joulecast::statistics
