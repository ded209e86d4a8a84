#include "gap/diagnose/mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace joulecast::gap {
namespace {

using statistics::Candidate;
using statistics::Evidence;
using statistics::Information;

constexpr std::size_t most_stretches = 8;     // in which a strength may wander
constexpr double implausible_log_odds = 9.2;  // log odds, 1 to 10,000, from which circumstances are dropped

double log_sum(const std::vector<double>& logs) {
  const double top = *std::ranges::max_element(logs);
  double sum = 0;
  for (const double l : logs) sum += std::exp(l - top);
  return top + std::log(sum);
}

std::vector<const Candidate*> candidates_of(const Problem& problem, const HypothesisSet& set) {
  std::vector<const Candidate*> candidates;
  for (const std::size_t h : set) candidates.push_back(&problem.hypotheses[h].candidate);
  return candidates;
}

Information sum_of(const std::vector<Information>& blocks, const std::vector<bool>& left_out) {
  Information total;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (left_out.empty() || !left_out[b]) total += blocks[b];
  }
  if (total.xx.size() == 0 && !blocks.empty()) return Information(blocks.front().xx.rows());
  return total;
}

}  // namespace

Mixture::Mixture(const Problem& problem, const std::vector<bool>& left_out)
    : problem_(&problem), left_out_(left_out) {
  std::vector<Information> totals;
  for (const auto& blocks : problem.blocks) totals.push_back(sum_of(blocks, left_out));
  std::vector<Part> all;
  for (const Circumstances& now : problem.circumstances) {
    Evidence evidence(totals[now.noise], now.tolerance);
    all.push_back({&now, now.log_prior + evidence.log_density(), std::move(evidence)});
  }
  // Under each set the best circumstances stay, and those near them.
  std::vector<bool> kept(all.size(), false);
  const auto look = [&](const HypothesisSet& set) {
    const auto candidates = candidates_of(problem, set);
    std::vector<double> logs;
    for (const Part& part : all) logs.push_back(part.log_weight + part.evidence.log_odds(candidates));
    const double top = *std::ranges::max_element(logs);
    for (std::size_t k = 0; k < logs.size(); ++k) kept[k] = kept[k] || logs[k] > top - implausible_log_odds;
  };
  look({});
  for (std::size_t h = 0; h < problem.hypotheses.size(); ++h) look({h});
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (kept[k]) parts_.push_back(std::move(all[k]));
  }
}

Mixture::Mixture(const Problem& problem, const std::vector<bool>& left_out,
                 const std::vector<std::size_t>& columns)
    : problem_(&problem), left_out_(left_out) {
  const Circumstances& now = problem.plain;
  Evidence evidence(sum_of(problem.blocks[now.noise], left_out), now.tolerance, columns);
  parts_.push_back({&now, evidence.log_density(), std::move(evidence)});
}

std::vector<double> Mixture::log_terms(const HypothesisSet& set) const {
  const auto candidates = candidates_of(*problem_, set);
  std::vector<double> logs;
  for (const Part& part : parts_) logs.push_back(part.log_weight + part.evidence.log_odds(candidates));
  return logs;
}

double Mixture::log_joint(const HypothesisSet& set) const {
  return log_sum(log_terms(set));
}

Mixture::Estimate Mixture::estimate(const HypothesisSet& set) const {
  Estimate e;
  if (set.empty()) return e;
  const auto candidates = candidates_of(*problem_, set);
  const std::vector<double> logs = log_terms(set);
  const double total = log_sum(logs);
  Eigen::VectorXd square;
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    const double weight = std::exp(logs[k] - total);
    const Evidence::Estimate part = parts_[k].evidence.estimate(candidates);
    if (e.mean.size() == 0) e.mean = square = Eigen::VectorXd::Zero(part.mean.size());
    e.mean += weight * part.mean;
    square += weight * (part.mean.cwiseAbs2() + part.sd.cwiseAbs2());
  }
  e.sd = (square - e.mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  return e;
}

const Mixture::Part& Mixture::likeliest(const HypothesisSet& set) const {
  const std::vector<double> logs = log_terms(set);
  return parts_[static_cast<std::size_t>(std::ranges::max_element(logs) - logs.begin())];
}

// Neighbouring blocks together, of equal weight in what they say of these columns.
std::vector<Information> Mixture::stretches_of(std::size_t noise,
                                               const std::vector<std::size_t>& columns) const {
  const auto& blocks = problem_->blocks[noise];
  const auto weight = [&](std::size_t b) {
    double sum = 0;
    for (const std::size_t k : columns)
      sum += blocks[b].xx(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k));
    return left_out_.empty() || !left_out_[b] ? sum : 0;
  };
  double all = 0, before = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) all += weight(b);
  std::vector<Information> stretches(most_stretches);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (!left_out_.empty() && left_out_[b]) continue;
    const double place = all > 0 ? (before + 0.5 * weight(b)) / all : 0;
    stretches[std::min(most_stretches - 1, static_cast<std::size_t>(place * most_stretches))] += blocks[b];
    before += weight(b);
  }
  std::erase_if(stretches, [](const Information& i) { return i.xx.size() == 0; });
  return stretches;
}

std::vector<double> Mixture::wander(const HypothesisSet& set, std::size_t member) const {
  const Part& part = likeliest(set);
  const Circumstances& now = *part.circumstances;
  const auto candidates = candidates_of(*problem_, set);
  const Evidence::Estimate estimate = part.evidence.estimate(candidates);
  const Candidate& own = problem_->hypotheses[set[member]].candidate;
  Eigen::Index first = 0;
  for (std::size_t k = 0; k < member; ++k)
    first += static_cast<Eigen::Index>(problem_->hypotheses[set[k]].candidate.columns.size());
  const double strength = estimate.mean.segment(first, static_cast<Eigen::Index>(own.columns.size())).norm();
  std::vector<std::size_t> columns;
  for (const Candidate* c : candidates) columns.insert(columns.end(), c->columns.begin(), c->columns.end());
  std::ranges::sort(columns);
  const std::vector<Information> stretches = stretches_of(now.noise, own.columns);
  std::vector<double> result;
  for (const double relative : wander_grid) {
    Eigen::VectorXd sd = Eigen::VectorXd::Zero(now.tolerance.size());
    for (const std::size_t k : own.columns) sd[static_cast<Eigen::Index>(k)] = relative * strength;
    Information total;
    for (Information stretch : stretches) {
      if (relative > 0) stretch.integrate_out(sd);
      total += stretch;
    }
    const Evidence evidence(total, now.tolerance, columns);
    const double z = relative / usual_wander;
    result.push_back(evidence.log_density() + evidence.log_odds(candidates) - 0.5 * z * z);
  }
  // Grid points stand for the stretch around them.
  for (std::size_t k = 0; k < result.size(); ++k) {
    const double low = k == 0 ? wander_grid[0] : wander_grid[k - 1];
    const double high = k + 1 < wander_grid.size() ? wander_grid[k + 1] : wander_grid[k];
    result[k] += std::log(0.5 * (high - low));
  }
  const double total = log_sum(result);
  for (double& r : result) r = std::exp(r - total);
  return result;
}

double Mixture::mean_wander(const HypothesisSet& set, std::size_t member) const {
  const std::vector<double> probability = wander(set, member);
  return std::inner_product(probability.begin(), probability.end(), wander_grid.begin(), 0.0);
}

std::vector<double> Mixture::by_block(const HypothesisSet& set, std::size_t member) const {
  const std::vector<double> likely = wander(set, member);
  const double relative =
      wander_grid[static_cast<std::size_t>(std::ranges::max_element(likely) - likely.begin())];
  const Part& part = likeliest(set);
  const Evidence::Estimate estimate = part.evidence.estimate(candidates_of(*problem_, set));
  // All other coefficients as they are found for all blocks.
  Eigen::VectorXd others = Eigen::VectorXd::Zero(part.circumstances->tolerance.size());
  Eigen::Index at = 0, own = 0;
  for (std::size_t k = 0; k < set.size(); ++k) {
    for (const std::size_t column : problem_->hypotheses[set[k]].candidate.columns) {
      if (k == member && column == problem_->hypotheses[set[k]].candidate.columns.front()) own = at;
      others[static_cast<Eigen::Index>(column)] = estimate.mean[at++];
    }
  }
  const double mean = estimate.mean[own];
  const auto column = static_cast<Eigen::Index>(problem_->hypotheses[set[member]].candidate.columns.front());
  others[column] = 0;
  const double precision = 1 / std::max(std::pow(relative * mean, 2), 1e-300);
  std::vector<double> strengths;
  const auto& blocks = problem_->blocks[part.circumstances->noise];
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (!left_out_.empty() && left_out_[b]) {
      strengths.push_back(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    const double says = blocks[b].xy[column] - blocks[b].xx.col(column).dot(others),
                 weight = blocks[b].xx(column, column);
    strengths.push_back(relative > 0 ? (says + precision * mean) / (weight + precision) : mean);
  }
  return strengths;
}

}  // namespace joulecast::gap
