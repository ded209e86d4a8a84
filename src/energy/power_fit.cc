#include "energy/power_fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::energy {
namespace {

constexpr int most_rounds = 60;
constexpr double settled = 1e-3;  // of a parameter's expected deviation
constexpr double first_damping = 1e-3, most_damping = 1e4;
constexpr double least_spread = 2e-3;        // of the mean power: keeps the weights of exact data finite
constexpr std::size_t fewest_to_class = 20;  // windows that have a spread of their own
constexpr auto parameter_count = static_cast<Eigen::Index>(power_parameter_count);

// Measured less modelled power of the windows in use.
class Misfit {
 public:
  Misfit(const PowerParameters& parameters, const PowerWindows& data,
         const std::function<bool(std::size_t)>& use)
      : parameters_(parameters) {
    for (std::size_t k = 0; k < data.windows.size(); ++k)
      if (data.whole[k] && use(data.windows[k].block)) windows_.push_back(&data.windows[k]);
  }

  Eigen::Index rows() const { return static_cast<Eigen::Index>(windows_.size()); }
  const windows::Window& window(Eigen::Index k) const { return *windows_[static_cast<std::size_t>(k)]; }

  Eigen::VectorXd left(const Eigen::VectorXd& x) const {
    const dynamics::DriveModel model = parameters_.model(x);
    Eigen::VectorXd e(rows());
    for (Eigen::Index k = 0; k < e.size(); ++k)
      e[k] = window(k).battery_power_w - metered_power_w(model, window(k));
    return e;
  }

  // Derivatives of the model by each parameter [W], by finite differences from the residuals at x.
  Eigen::MatrixXd slopes(const Eigen::VectorXd& x, const Eigen::VectorXd& here) const {
    constexpr double step = 1e-4;
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(rows(), parameter_count);
    for (Eigen::Index p = 0; p < parameter_count; ++p) {
      if (!(parameters_.expected(static_cast<PowerParameter>(p)) > 0)) continue;
      Eigen::VectorXd up = x;
      up[p] += step;
      j.col(p) = (here - left(up)) / step;
    }
    return j;
  }

 private:
  const PowerParameters& parameters_;
  std::vector<const windows::Window*> windows_;
};

struct Weights {
  Eigen::VectorXd of_row;  // 1/W
  double spread_w = 0;     // of moving windows
};

// Huber's weights over each window's spread.
Weights weigh(const Misfit& misfit, const Eigen::VectorXd& left, double power_w) {
  Weights w{Eigen::VectorXd::Zero(left.size()), 0};
  for (const bool resting : {true, false}) {
    std::vector<Eigen::Index> rows;
    std::vector<double> errors;
    for (Eigen::Index k = 0; k < left.size(); ++k) {
      if ((misfit.window(k).resting[0] && misfit.window(k).resting[1]) != resting) continue;
      rows.push_back(k);
      errors.push_back(left[k]);
    }
    if (errors.size() < fewest_to_class) errors.assign(left.begin(), left.end());
    const double spread = std::max(statistics::spread_about_zero(errors), least_spread * power_w);
    const Eigen::VectorXd own = left(rows);
    w.of_row(rows) = statistics::huber_weights(own, spread).cwiseSqrt() / spread;
    w.spread_w = spread;
  }
  return w;
}

// Minimum of a quadratic, x' A x / 2 - g' x, between bounds. A parameter that reaches a bound stays there and
// is not released again (the number of parameters bounds the rounds).
Eigen::VectorXd bounded_step(const Eigen::MatrixXd& a, const Eigen::VectorXd& g, const Eigen::VectorXd& least,
                             const Eigen::VectorXd& most) {
  Eigen::VectorXd step = Eigen::VectorXd::Zero(g.size());
  std::vector<Eigen::Index> moving;
  for (Eigen::Index k = 0; k < g.size(); ++k)
    if (!(g[k] < 0 && least[k] >= 0) && !(g[k] > 0 && most[k] <= 0)) moving.push_back(k);
  while (!moving.empty()) {
    const Eigen::VectorXd rest = g - a * step;
    const Eigen::VectorXd own =
        a(moving, moving).ldlt().solve(rest(moving) + a(moving, moving) * step(moving));
    std::vector<Eigen::Index> inside;
    for (std::size_t k = 0; k < moving.size(); ++k) {
      const Eigen::Index at = moving[k];
      const double wanted = own[static_cast<Eigen::Index>(k)];
      step[at] = std::clamp(wanted, least[at], most[at]);
      if (step[at] == wanted) inside.push_back(at);
    }
    if (inside.size() == moving.size()) break;
    moving = std::move(inside);
  }
  return step;
}

// Sums of scores over blocks, a row each, about their mean.
Eigen::MatrixXd scores(const Misfit& misfit, const Eigen::MatrixXd& weighted, const Eigen::VectorXd& left) {
  std::map<std::size_t, Eigen::VectorXd> by_block;
  for (Eigen::Index k = 0; k < left.size(); ++k) {
    auto& sum =
        by_block.try_emplace(misfit.window(k).block, Eigen::VectorXd::Zero(parameter_count)).first->second;
    sum += left[k] * weighted.row(k).transpose();
  }
  Eigen::MatrixXd all(static_cast<Eigen::Index>(by_block.size()), parameter_count);
  Eigen::Index row = 0;
  for (const auto& [block, score] : by_block) all.row(row++) = score.transpose();
  all.rowwise() -= all.colwise().mean().eval();
  return all;
}

struct Linear {
  Eigen::MatrixXd weighted;  // slopes by the spread of each row
  Eigen::VectorXd left;      // residuals, weighted likewise
  Eigen::MatrixXd information, scatter;
  double inflation = 1;
};

Linear linearise(const Misfit& misfit, const Weights& weights, const Eigen::VectorXd& x,
                 const Eigen::VectorXd& left) {
  Linear l;
  l.weighted = weights.of_row.asDiagonal() * misfit.slopes(x, left);
  l.left = weights.of_row.cwiseProduct(left);
  l.information = l.weighted.transpose() * l.weighted;
  const Eigen::MatrixXd score = scores(misfit, l.weighted, l.left);
  const auto blocks = static_cast<double>(score.rows());
  l.scatter = (blocks > 1 ? blocks / (blocks - 1) : 1) * score.transpose() * score;
  std::vector<double> ratios;
  for (Eigen::Index p = 0; p < parameter_count; ++p)
    if (l.information(p, p) > 0) ratios.push_back(l.scatter(p, p) / l.information(p, p));
  // The median: idle power that drifts from mission to mission does not show how well friction is identified.
  if (!ratios.empty()) l.inflation = std::max(1.0, statistics::median(std::move(ratios)));
  return l;
}

// Computes the information of the data and the standard deviations.
void judge(const PowerParameters& parameters, const Linear& l, PowerFit& fit) {
  fit.inflation = l.inflation;
  fit.information = l.information / l.inflation;
  std::vector<Eigen::Index> known;
  for (Eigen::Index p = 0; p < parameter_count; ++p)
    if (parameters.expected(static_cast<PowerParameter>(p)) > 0) known.push_back(p);
  const auto n = static_cast<Eigen::Index>(known.size());
  const Eigen::MatrixXd prior = Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd covariance = (fit.information(known, known) + prior).inverse();
  const Eigen::MatrixXd middle = l.scatter(known, known) / (l.inflation * l.inflation) + prior;
  const Eigen::MatrixXd own = covariance * middle * covariance;
  fit.deviation = Eigen::VectorXd::Zero(parameter_count);
  for (Eigen::Index k = 0; k < n; ++k)
    fit.deviation[known[static_cast<std::size_t>(k)]] = std::sqrt(std::max(covariance(k, k), own(k, k)));
}

// Damped Gauss-Newton steps between bounds, with weights and inflation of the point where each begins.
class Descent {
 public:
  Descent(const PowerParameters& parameters, const Misfit& misfit, const PowerFree& free, double power_w)
      : misfit_(misfit), power_w_(power_w) {
    for (std::size_t p = 0; p < power_parameter_count; ++p)
      if (free[p] && parameters.expected(static_cast<PowerParameter>(p)) > 0)
        moved_.push_back(static_cast<Eigen::Index>(p));
    const auto n = static_cast<Eigen::Index>(moved_.size());
    least_.resize(n), most_.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto p = static_cast<PowerParameter>(moved_[static_cast<std::size_t>(k)]);
      least_[k] = parameters.least(p), most_[k] = parameters.most(p);
    }
  }

  Eigen::VectorXd within(Eigen::VectorXd x) const {
    x(moved_) = x(moved_).cwiseMax(least_).cwiseMin(most_).eval();
    return x;
  }

  // Moves x; false on convergence.
  bool step(Eigen::VectorXd& x) {
    const Eigen::VectorXd left = misfit_.left(x);
    const Weights weights = weigh(misfit_, left, power_w_);
    const Linear l = linearise(misfit_, weights, x, left);
    const Eigen::VectorXd start = x(moved_);
    const auto worth = [&](const Eigen::VectorXd& at) {
      return weights.of_row.cwiseProduct(misfit_.left(at)).squaredNorm() / l.inflation +
             at(moved_).squaredNorm();
    };
    const Eigen::MatrixXd a = l.information(moved_, moved_) / l.inflation;
    const Eigen::VectorXd g = (l.weighted.transpose() * l.left)(moved_) / l.inflation - start;
    const double before = l.left.squaredNorm() / l.inflation + start.squaredNorm();
    for (; damping_ < most_damping; damping_ *= 10) {
      Eigen::MatrixXd damped = a;
      damped.diagonal() *= 1 + damping_;
      damped.diagonal().array() += 1;
      const Eigen::VectorXd moved = bounded_step(damped, g, least_ - start, most_ - start);
      Eigen::VectorXd next = x;
      next(moved_) = start + moved;
      if (!(worth(next) < before)) continue;
      x = next;
      damping_ = std::max(damping_ / 100, 1e-9);
      return moved.cwiseAbs().maxCoeff() > settled;
    }
    return false;
  }

 private:
  const Misfit& misfit_;
  double power_w_;
  std::vector<Eigen::Index> moved_;
  Eigen::VectorXd least_, most_;
  double damping_ = first_damping;
};

}  // namespace

Result<PowerFit> fit_power(const PowerParameters& parameters, const PowerWindows& data,
                           const std::function<bool(std::size_t block)>& use, const PowerFree& free,
                           const Eigen::VectorXd& start) {
  const Misfit misfit(parameters, data, use);
  if (misfit.rows() == 0)
    return invalid("runs", "hold no window with battery power in which wheels keep moving or still");
  const double power_w = scale_of(data.windows).power_w;
  Descent descent(parameters, misfit, free, power_w);
  PowerFit fit{descent.within(start), {}, {}, 1, 0};
  for (int round = 0; round < most_rounds && descent.step(fit.x); ++round) continue;
  const Eigen::VectorXd left = misfit.left(fit.x);
  const Weights weights = weigh(misfit, left, power_w);
  fit.spread_w = weights.spread_w;
  judge(parameters, linearise(misfit, weights, fit.x, left), fit);
  return fit;
}

}  // namespace joulecast::energy
