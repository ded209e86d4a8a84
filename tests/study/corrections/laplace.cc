#include "tests/study/corrections/laplace.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace joulecast::gap::corrections {
namespace {

using Eigen::ArrayXXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double tail = 3;                // degrees of freedom of Student's t
constexpr double of_sd = 1e-3;            // step of a difference quotient
constexpr double mean_to_sd = 1.2533;     // of a Gaussian: sqrt(pi / 2)
constexpr double least_step_gain = 0.05;  // nats for which another step is made

double beyond(const Unknown& u, double x) {
  return std::max(std::fabs(x) - u.wall, 0.0) / u.sd;
}

double minus_log_prior(const Problem& problem, const VectorXd& x) {
  double sum = 0;
  for (std::size_t k = 0; k < problem.unknowns.size(); ++k) {
    const Unknown& u = problem.unknowns[k];
    const double z = x[static_cast<Index>(k)] / u.sd, over = beyond(u, x[static_cast<Index>(k)]);
    sum += u.heavy ? (tail + 1) / 2 * std::log1p(z * z / tail) + over * over / 2 : z * z / 2;
  }
  return sum;
}

struct Size {
  double sum_abs = 0, sum_square = 0, rows = 0;
};

Size size_of(const Comparison& c, Index witness) {
  Size s;
  for (Index r = 0; r < c.residual.rows(); ++r) {
    const double e = c.residual(r, witness), y = c.reading(r, witness);
    if (!std::isfinite(e + y)) continue;
    s.sum_abs += std::fabs(e);
    s.sum_square += y * y;
    s.rows += 1;
  }
  return s;
}

std::vector<double> relatives(const Problem& problem, const Comparison& c) {
  std::vector<double> all(problem.independent.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Size s = size_of(c, static_cast<Index>(k));
    all[k] = relative_residual(s.sum_abs, s.sum_square, s.rows, problem.fewest[k]);
  }
  return all;
}

double surprise_of(const Problem& problem, const Comparison& c) {
  const std::vector<double> all = relatives(problem, c);
  double sum = 0;
  for (std::size_t k = 0; k < all.size(); ++k) sum += surprise(problem.independent[k], all[k]);
  return sum;
}

// Curvature and slope of minus the log posterior.
struct Quadratic {
  MatrixXd curvature;
  VectorXd slope;
};

Quadratic quadratic(const Problem& problem, const VectorXd& x, const Comparison& c) {
  const Index n = x.size();
  Quadratic q{MatrixXd::Zero(n, n), VectorXd::Zero(n)};
  for (Index k = 0; k < n; ++k) {
    const Unknown& u = problem.unknowns[static_cast<std::size_t>(k)];
    const double z = x[k] / u.sd, over = u.heavy ? beyond(u, x[k]) : 0;
    const double stiff = (u.heavy ? (tail + 1) / (tail + z * z) : 1.0) / (u.sd * u.sd);
    q.curvature(k, k) = stiff + (over > 0 ? 1 / (u.sd * u.sd) : 0);
    q.slope[k] = stiff * x[k] + over * std::copysign(1.0, x[k]) / u.sd;
  }
  std::vector<Comparison> moved(static_cast<std::size_t>(n));
  std::vector<double> step(static_cast<std::size_t>(n));
  for (std::size_t k = 0; k < moved.size(); ++k) {
    VectorXd at = x;
    step[k] = of_sd * problem.unknowns[k].sd;
    at[static_cast<Index>(k)] += step[k];
    problem.compare(at, moved[k]);
  }
  const auto first_rescaling = moved.size() - problem.rescaling;
  const std::vector<double> relative = relatives(problem, c);
  for (std::size_t w = 0; w < relative.size(); ++w) {
    const auto col = static_cast<Index>(w);
    const Size size = size_of(c, col);
    if (size.rows < problem.fewest[w] || size.rows == 0) continue;
    const double reading = std::sqrt(size.sum_square / size.rows) + 1e-12;
    std::vector<double> scale(moved.size(), 1);
    for (std::size_t k = first_rescaling; k < moved.size(); ++k) {
      const Size other = size_of(moved[k], col);
      scale[k] = reading / (std::sqrt(other.sum_square / std::max(other.rows, 1.0)) + 1e-12);
    }
    const double rho = relative[w];
    const double weight = problem.independent[w] * rho * mean_to_sd /
                          ((rho * rho + floor_share * floor_share) * reading * size.rows);
    const double least = 0.3 * reading * std::max(rho, 0.02);
    MatrixXd rows(static_cast<Index>(size.rows), n);
    VectorXd error(rows.rows());
    Index used = 0;
    for (Index r = 0; r < c.residual.rows(); ++r) {
      const double e = c.residual(r, col);
      if (!std::isfinite(e + c.reading(r, col))) continue;
      const double root = std::sqrt(weight / std::max(std::fabs(e), least));
      for (std::size_t k = 0; k < moved.size(); ++k) {
        const double d = (moved[k].residual(r, col) * scale[k] - e) / step[k];
        rows(used, static_cast<Index>(k)) = std::isfinite(d) ? root * d : 0;
      }
      error[used++] = root * e;
    }
    q.curvature.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
    q.slope += rows.transpose() * error;
  }
  q.curvature.triangularView<Eigen::StrictlyUpper>() = q.curvature.transpose();
  return q;
}

}  // namespace

double relative_residual(double sum_abs, double sum_square, double rows, double fewest) {
  if (rows < fewest || rows <= 0) return 1;
  return mean_to_sd * sum_abs / rows / (std::sqrt(sum_square / rows) + 1e-12);
}

double surprise(double independent, double relative) {
  return independent / 2 * std::log(relative * relative + floor_share * floor_share);
}

Maximum maximise(const Problem& problem, VectorXd x, int steps) {
  const Index n = x.size();
  Comparison here;
  problem.compare(x, here);
  double prior = minus_log_prior(problem, x), loss = prior + surprise_of(problem, here);
  Quadratic q;
  std::vector<Index> live;
  for (int step = 0;; ++step) {
    q = quadratic(problem, x, here);
    live.clear();
    for (Index k = 0; k < n; ++k) {
      const Unknown& u = problem.unknowns[static_cast<std::size_t>(k)];
      if (!u.positive || x[k] > 0 || q.slope[k] <= 0) live.push_back(k);
    }
    if (step == steps) break;
    MatrixXd a = q.curvature(live, live);
    a.diagonal() *= 1 + 1e-9;
    VectorXd move = VectorXd::Zero(n);
    move(live) = -a.ldlt().solve(VectorXd(q.slope(live)));
    double best = loss;
    VectorXd best_at;
    for (const double part : {1.0, 0.4, 0.1}) {
      VectorXd at = x + part * move;
      for (Index k = 0; k < n; ++k) {
        const Unknown& u = problem.unknowns[static_cast<std::size_t>(k)];
        if (step == 0) at[k] = x[k] + std::clamp(at[k] - x[k], -3 * u.sd, 3 * u.sd);
        if (u.positive) at[k] = std::max(at[k], 0.0);
      }
      Comparison there;
      problem.compare(at, there);
      const double now = minus_log_prior(problem, at) + surprise_of(problem, there);
      if (!(now < best - 1e-6)) continue;
      best = now;
      best_at = at;
      here = std::move(there);
      if (problem.rescaling > 0) break;
    }
    if (best_at.size() == 0) break;
    const bool last = loss - best < least_step_gain;
    x = best_at;
    loss = best;
    if (last) break;
  }
  Maximum m;
  m.minus_log_prior = minus_log_prior(problem, x);
  VectorXd sd(n);
  for (Index k = 0; k < n; ++k) sd[k] = problem.unknowns[static_cast<std::size_t>(k)].sd;
  const MatrixXd scaled = sd(live).asDiagonal() * q.curvature(live, live) * sd(live).asDiagonal();
  const Eigen::LDLT<MatrixXd> factors(scaled);
  m.half_log_determinant = factors.vectorD().cwiseMax(1e-300).array().log().sum() / 2;
  m.deviation = VectorXd::Zero(n);
  if (!live.empty()) {
    const auto size = static_cast<Index>(live.size());
    const MatrixXd inverse = factors.solve(MatrixXd::Identity(size, size));
    m.deviation(live) = (inverse.diagonal().cwiseMax(0).cwiseSqrt().array() * sd(live).array()).matrix();
  }
  m.log_evidence = -loss - m.half_log_determinant;
  m.relative = relatives(problem, here);
  m.at = std::move(x);
  m.comparison = std::move(here);
  return m;
}

}  // namespace joulecast::gap::corrections
