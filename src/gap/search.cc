#include "gap/search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace joulecast::gap {
namespace {

double log_twice_normal(double z) {  // log(2 Phi(z))
  if (z > -20) return std::log(std::erfc(-z / std::numbers::sqrt2));
  // Far below zero by the asymptotic series, where the tail itself underflows.
  return -0.5 * z * z - std::log(-z * std::sqrt(0.5 * std::numbers::pi)) + std::log1p(-1 / (z * z));
}

// Slip and a smaller wheel are one thing to every channel but the inertia's.
bool moves_less_than_it_rolls(const Hypothesis& h) {
  const std::string_view id = h.effect.effect->info().id;
  return id == "wheel_slip" || id == "wheel_radius_error";
}

}  // namespace

Evidence::Evidence(const ColumnSet& columns, const Information& total, double coarsening)
    : columns_(columns), total_(total) {
  const auto p = static_cast<Eigen::Index>(columns.size());
  unit_.resize(p);
  for (Eigen::Index k = 0; k < p; ++k) {
    const Column& c = columns.columns()[static_cast<std::size_t>(k)];
    unit_[k] = c.tolerance > 0 ? c.tolerance : 1e-9 * std::max(1.0, c.scatter);
  }
  const Eigen::MatrixXd scaled = coarsening * (unit_.asDiagonal() * total.xx * unit_.asDiagonal());
  const Eigen::VectorXd scaled_y = coarsening * (unit_.asDiagonal() * total.xy);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (scaled + scaled.transpose()));
  const Eigen::VectorXd d = eigen.eigenvalues().cwiseMax(0.0);
  const Eigen::VectorXd shrink = (1.0 + d.array()).inverse();
  const Eigen::MatrixXd& q = eigen.eigenvectors();
  xx_ = q * (d.array() * shrink.array()).matrix().asDiagonal() * q.transpose();
  xy_ = q * (shrink.asDiagonal() * (q.transpose() * scaled_y));
}

double Evidence::log_odds(std::span<const std::size_t> hypotheses) const {
  std::vector<Eigen::Index> index;
  std::vector<double> ratio;
  std::vector<bool> nonnegative;
  double result = 0;
  for (const std::size_t h : hypotheses) {
    const Hypothesis& hypothesis = columns_.hypotheses()[h];
    result += hypothesis.log_prior;
    for (const std::size_t k : hypothesis.columns) {
      index.push_back(static_cast<Eigen::Index>(k));
      ratio.push_back(hypothesis.expected / unit_[static_cast<Eigen::Index>(k)]);
      nonnegative.push_back(hypothesis.nonnegative);
    }
  }
  if (index.empty()) return 0;
  const auto n = static_cast<Eigen::Index>(index.size());
  const Eigen::Map<const Eigen::VectorXd> scale(ratio.data(), n);
  Eigen::MatrixXd a = scale.asDiagonal() * xx_(index, index) * scale.asDiagonal();
  a.diagonal().array() += 1.0;
  const Eigen::VectorXd b = scale.asDiagonal() * xy_(index);
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  if (factor.info() != Eigen::Success) return -1e300;
  const Eigen::VectorXd mean = factor.solve(b);
  result += 0.5 * b.dot(mean);
  for (Eigen::Index k = 0; k < n; ++k) result -= std::log(factor.matrixLLT()(k, k));
  Eigen::MatrixXd covariance;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!nonnegative[static_cast<std::size_t>(k)]) continue;
    if (covariance.size() == 0) covariance = factor.solve(Eigen::MatrixXd::Identity(n, n));
    result += log_twice_normal(mean[k] / std::sqrt(covariance(k, k)));
  }
  return result;
}

double Evidence::separation(std::size_t a, std::size_t b, double strength) const {
  const auto i = static_cast<Eigen::Index>(columns_.hypotheses()[a].columns[0]);
  const auto j = static_cast<Eigen::Index>(columns_.hypotheses()[b].columns[0]);
  const double scaled = strength / unit_[i];
  const double prior = std::pow(unit_[j] / columns_.hypotheses()[b].expected, 2);
  return 0.5 * scaled * scaled * std::max(0.0, xx_(i, i) - xx_(i, j) * xx_(i, j) / (xx_(j, j) + prior));
}

Evidence::Estimate Evidence::estimate(std::span<const std::size_t> hypotheses) const {
  const auto p = static_cast<Eigen::Index>(columns_.size());
  Eigen::VectorXd sd = unit_;
  for (const std::size_t h : hypotheses) {
    for (const std::size_t k : columns_.hypotheses()[h].columns) {
      sd[static_cast<Eigen::Index>(k)] =
          std::hypot(sd[static_cast<Eigen::Index>(k)], columns_.hypotheses()[h].expected);
    }
  }
  // Other shapes of a chosen effect would share its strength; with its shape chosen they are out.
  for (const std::size_t h : hypotheses) {
    const Hypothesis& chosen = columns_.hypotheses()[h];
    if (chosen.outside() || !chosen.one_shape) continue;
    for (const Hypothesis& other : columns_.hypotheses()) {
      if (other.effect.effect != chosen.effect.effect || &other == &chosen) continue;
      for (const std::size_t k : other.columns) sd[static_cast<Eigen::Index>(k)] *= 1e-6;
    }
  }
  Eigen::MatrixXd a = sd.asDiagonal() * total_.xx * sd.asDiagonal();
  a.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  Estimate result;
  result.mean = sd.asDiagonal() * factor.solve(sd.asDiagonal() * total_.xy);
  result.covariance = sd.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(p, p)) * sd.asDiagonal();
  result.sd = result.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return result;
}

std::vector<Explanation> search(const Evidence& evidence, const SearchSettings& settings) {
  const auto& all = evidence.columns().hypotheses();
  std::vector<Explanation> found{{{}, 0.0}};
  std::vector<Explanation> beam = found;
  std::set<std::vector<std::size_t>> seen;
  for (std::size_t size = 1; size <= settings.most_effects && !beam.empty(); ++size) {
    std::vector<Explanation> next;
    for (const Explanation& base : beam) {
      for (std::size_t h = 0; h < all.size(); ++h) {
        // One variant of an effect at a time.
        const bool taken = std::ranges::any_of(base.hypotheses, [&](std::size_t other) {
          return other == h || (!all[other].outside() && !all[h].outside() &&
                                (all[other].effect.effect == all[h].effect.effect ||
                                 (moves_less_than_it_rolls(all[other]) && moves_less_than_it_rolls(all[h]))));
        });
        if (taken) continue;
        Explanation candidate = base;
        candidate.hypotheses.push_back(h);
        std::ranges::sort(candidate.hypotheses);
        if (!seen.insert(candidate.hypotheses).second) continue;
        candidate.log_odds = evidence.log_odds(candidate.hypotheses);
        next.push_back(std::move(candidate));
      }
    }
    std::ranges::sort(next, std::greater{}, &Explanation::log_odds);
    found.insert(found.end(), next.begin(), next.end());
    next.resize(std::min(next.size(), settings.beam));
    beam = std::move(next);
  }
  std::ranges::sort(found, std::greater{}, &Explanation::log_odds);
  return found;
}

}  // namespace joulecast::gap
