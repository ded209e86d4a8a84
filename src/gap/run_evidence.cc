#include "gap/run_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

namespace joulecast::gap {
namespace {

// Standard deviation of an error that scales all of a model's energies, within the calibration of a robot
// that is as its file says and of the meter that measured it.
constexpr double common_scale = 0.01;
// Scatters are looked for on these grids, evenly in their logarithm.
constexpr std::array run_scatters{0.004, 0.008, 0.016, 0.032, 0.064, 0.128};
constexpr std::array table_scatters{0.004, 0.01, 0.02, 0.04, 0.08};
// From day to day and floor to floor the energy of one mission changes by a percent or two.
constexpr double usual_table_scatter = 0.02;
constexpr double plausible = 1e-4;  // scatters less probable than this beside the best are let go
constexpr std::size_t beam = 10;
constexpr double impossible = -1e300;

double normal_below(double z) {
  return 0.5 * std::erfc(-z / std::sqrt(2.0));
}

// Log of the probability that a normal variable lies within bounds.
double log_within(double mean, double sd, double least, double most) {
  return std::log(std::max(normal_below((most - mean) / sd) - normal_below((least - mean) / sd), 1e-300));
}

double log_sum(std::span<const double> logs) {
  const double top = *std::ranges::max_element(logs);
  double sum = 0;
  for (const double l : logs) sum += std::exp(l - top);
  return top + std::log(sum);
}

}  // namespace

RunSums::RunSums(std::size_t tables, std::size_t columns) : columns_(columns), parts_(2 * tables) {
  const auto n = static_cast<Eigen::Index>(columns + 2);
  for (Part& part : parts_) part = {0, Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
}

void RunSums::add(const RunEquation& equation, double sign) {
  Part& part = parts_[2 * equation.table + (equation.difference ? 1 : 0)];
  part.count += sign;
  part.square += sign * equation.values * equation.values.transpose();
  part.sum += sign * equation.values;
}

RunSums::Products RunSums::products(const RunScatter& scatter) const {
  const auto n = static_cast<Eigen::Index>(columns_ + 2);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(n, n);
  Products p;
  const double shift = scatter.table * scatter.table;
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    const Part& part = parts_[k];
    if (part.count < 0.5) continue;
    const double sd = k % 2 == 0 ? scatter.run : scatter.difference;
    const double variance = sd * sd;
    gram +=
        (part.square - shift / (variance + part.count * shift) * part.sum * part.sum.transpose()) / variance;
    p.log_scale -= 0.5 * (part.count * std::log(variance) + std::log1p(part.count * shift / variance));
  }
  const Eigen::Index scale = n - 2;
  const double information = gram(scale, scale) + 1 / (common_scale * common_scale);
  p.log_scale -= 0.5 * std::log(information * common_scale * common_scale);
  const Eigen::VectorXd along = gram.col(scale);
  gram -= along * along.transpose() / information;
  std::vector<Eigen::Index> kept(columns_ + 1);
  for (std::size_t k = 0; k < columns_; ++k) kept[k] = static_cast<Eigen::Index>(k);
  kept.back() = n - 1;
  p.gram = gram(kept, kept);
  p.log_scale -= 0.5 * p.gram(p.gram.rows() - 1, p.gram.rows() - 1);
  return p;
}

bool RunSums::with_differences() const {
  for (std::size_t k = 1; k < parts_.size(); k += 2) {
    if (parts_[k].count > 0.5) return true;
  }
  return false;
}

RunEvidence::RunEvidence(std::span<const RunCandidate> candidates, const RunSums& sums,
                         std::span<const std::size_t> sought)
    : candidates_(candidates) {
  const std::span<const double> differences =
      std::span(run_scatters).first(sums.with_differences() ? run_scatters.size() : 1);
  for (const double run : run_scatters) {
    for (const double difference : differences) {
      for (const double table : table_scatters) {
        const RunScatter scatter{run, difference, table};
        points_.push_back({scatter, sums.products(scatter)});
        points_.back().products.log_scale -= 0.5 * std::pow(table / usual_table_scatter, 2);
      }
    }
  }
  // Scatters that neither the plain model nor what is sought needs are implausible.
  std::vector<double> best(points_.size(), impossible);
  const auto look = [&](std::span<const std::size_t> set) {
    std::vector<double> logs;
    for (const Point& point : points_) logs.push_back(integrate(point, set).log_evidence);
    const double top = *std::ranges::max_element(logs);
    for (std::size_t k = 0; k < logs.size(); ++k) best[k] = std::max(best[k], logs[k] - top);
  };
  look({});
  if (!sought.empty()) {
    look(sought);
  } else {
    for (std::size_t c = 0; c < candidates_.size(); ++c) look({&c, 1});
  }
  std::vector<Point> kept;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    if (best[k] > std::log(plausible)) kept.push_back(std::move(points_[k]));
  }
  points_ = std::move(kept);
}

std::vector<std::size_t> RunEvidence::columns_of(std::span<const std::size_t> set) const {
  std::vector<std::size_t> columns;
  for (const std::size_t c : set)
    columns.insert(columns.end(), candidates_[c].columns.begin(), candidates_[c].columns.end());
  return columns;
}

RunEvidence::Gaussian RunEvidence::integrate(const Point& point, std::span<const std::size_t> set) const {
  Gaussian g;
  g.log_evidence = point.products.log_scale;
  const std::vector<std::size_t> columns = columns_of(set);
  if (columns.empty()) return g;
  const auto n = static_cast<Eigen::Index>(columns.size());
  Eigen::VectorXd unit(n), least(n), most(n);
  Eigen::Index at = 0;
  for (const std::size_t c : set) {
    g.log_evidence += candidates_[c].log_prior;
    for (std::size_t k = 0; k < candidates_[c].columns.size(); ++k, ++at) {
      unit[at] = candidates_[c].expected;
      least[at] = candidates_[c].least / unit[at];
      most[at] = candidates_[c].most / unit[at];
    }
  }
  const Eigen::MatrixXd& gram = point.products.gram;
  Eigen::MatrixXd a(n, n);
  Eigen::VectorXd b(n);
  const Eigen::Index response = gram.rows() - 1;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto ci = static_cast<Eigen::Index>(columns[static_cast<std::size_t>(i)]);
    b[i] = unit[i] * gram(ci, response);
    for (Eigen::Index j = 0; j < n; ++j) {
      a(i, j) = unit[i] * unit[j] * gram(ci, static_cast<Eigen::Index>(columns[static_cast<std::size_t>(j)]));
    }
    a(i, i) += 1;
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  if (factor.info() != Eigen::Success) {
    g.log_evidence = impossible;
    return g;
  }
  g.mean = factor.solve(b);
  g.covariance = factor.solve(Eigen::MatrixXd::Identity(n, n));
  g.log_evidence += 0.5 * b.dot(g.mean);
  for (Eigen::Index k = 0; k < n; ++k) {
    g.log_evidence -= std::log(factor.matrixLLT()(k, k));
    g.log_evidence += log_within(g.mean[k], std::sqrt(g.covariance(k, k)), least[k], most[k]) -
                      log_within(0, 1, least[k], most[k]);
  }
  return g;
}

double RunEvidence::log_evidence(std::span<const std::size_t> set) const {
  std::vector<double> logs;
  logs.reserve(points_.size());
  for (const Point& point : points_) logs.push_back(integrate(point, set).log_evidence);
  return log_sum(logs);
}

RunEstimate RunEvidence::estimate(std::span<const std::size_t> set) const {
  const auto n = static_cast<Eigen::Index>(columns_of(set).size());
  std::vector<Gaussian> parts;
  std::vector<double> logs;
  for (const Point& point : points_) {
    parts.push_back(integrate(point, set));
    logs.push_back(parts.back().log_evidence);
  }
  const double total = log_sum(logs);
  RunEstimate e{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), {}};
  Eigen::VectorXd square = Eigen::VectorXd::Zero(n);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const double weight = std::exp(logs[k] - total);
    e.scatter.run += weight * points_[k].scatter.run;
    e.scatter.difference += weight * points_[k].scatter.difference;
    e.scatter.table += weight * points_[k].scatter.table;
    if (n == 0) continue;
    e.mean += weight * parts[k].mean;
    square += weight * (parts[k].mean.cwiseAbs2() + parts[k].covariance.diagonal());
  }
  e.sd = (square - e.mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  Eigen::Index at = 0;
  for (const std::size_t c : set) {
    for (std::size_t k = 0; k < candidates_[c].columns.size(); ++k, ++at) {
      e.mean[at] =
          std::clamp(e.mean[at] * candidates_[c].expected, candidates_[c].least, candidates_[c].most);
      e.sd[at] *= candidates_[c].expected;
    }
  }
  return e;
}

double RunEvidence::likeness(std::size_t a, std::size_t b) const {
  const auto i = static_cast<Eigen::Index>(candidates_[a].columns.front());
  const auto j = static_cast<Eigen::Index>(candidates_[b].columns.front());
  double best = 0;
  double top = impossible;
  for (const Point& point : points_) {
    if (point.products.log_scale <= top) continue;
    top = point.products.log_scale;
    const Eigen::MatrixXd& g = point.products.gram;
    best = std::fabs(g(i, j)) / std::sqrt(std::max(g(i, i) * g(j, j), 1e-300));
  }
  return best;
}

std::vector<RunExplanation> RunEvidence::search(std::size_t most_effects) const {
  std::vector<RunExplanation> found{{{}, log_evidence({})}};
  std::vector<RunExplanation> front = found;
  std::set<std::vector<std::size_t>> seen;
  for (std::size_t size = 1; size <= most_effects && !front.empty(); ++size) {
    std::vector<RunExplanation> next;
    for (const RunExplanation& base : front) {
      for (std::size_t c = 0; c < candidates_.size(); ++c) {
        const bool taken = std::ranges::any_of(base.candidates, [&](std::size_t other) {
          return other == c || (!candidates_[c].outside() &&
                                candidates_[other].effect.effect == candidates_[c].effect.effect);
        });
        if (taken) continue;
        RunExplanation candidate = base;
        candidate.candidates.push_back(c);
        std::ranges::sort(candidate.candidates);
        if (!seen.insert(candidate.candidates).second) continue;
        candidate.log_evidence = log_evidence(candidate.candidates);
        next.push_back(std::move(candidate));
      }
    }
    std::ranges::sort(next, std::greater{}, &RunExplanation::log_evidence);
    found.insert(found.end(), next.begin(), next.end());
    next.resize(std::min(next.size(), beam));
    front = std::move(next);
  }
  std::ranges::sort(found, std::greater{}, &RunExplanation::log_evidence);
  return found;
}

}  // namespace joulecast::gap
