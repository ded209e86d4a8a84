#include "energy/power_fit.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::energy {
namespace {

constexpr int most_rounds = 12, steps_a_round = 4;
constexpr double settled = 2e-3;           // of what is expected of a parameter
constexpr double least_spread = 1e-4;      // of the mean power: what is exact is still to be weighed
constexpr std::size_t fewest_to_class = 20;  // windows that have a spread of their own
constexpr auto parameter_count = static_cast<Eigen::Index>(power_parameter_count);

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Measured less modelled power of the windows that take part.
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

  void left(const Eigen::VectorXd& x, double* out) const {
    const dynamics::DriveModel model = parameters_.model(x);
    for (const windows::Window* w : windows_) *out++ = w->battery_power_w - metered_power_w(model, *w);
  }
  Eigen::VectorXd left(const Eigen::VectorXd& x) const {
    Eigen::VectorXd e(rows());
    left(x, e.data());
    return e;
  }

  // What a unit more of each parameter adds to the model [W], by central differences.
  Eigen::MatrixXd slopes(const Eigen::VectorXd& x) const {
    constexpr double step = 1e-3;
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(rows(), parameter_count);
    for (Eigen::Index p = 0; p < parameter_count; ++p) {
      if (!(parameters_.expected(static_cast<PowerParameter>(p)) > 0)) continue;
      Eigen::VectorXd up = x, down = x;
      up[p] += step, down[p] -= step;
      j.col(p) = (left(down) - left(up)) / (2 * step);
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

// The weighted residuals and the prior's, as Ceres wants them.
struct Residuals {
  const Misfit& misfit;
  const Weights& weights;
  double inflation;
  const std::vector<Eigen::Index>& free;
  const Eigen::VectorXd& start;

  bool operator()(double const* const* given, double* residual) const {
    Eigen::VectorXd x = start;
    for (std::size_t k = 0; k < free.size(); ++k) x[free[k]] = given[0][k];
    misfit.left(x, residual);
    for (Eigen::Index k = 0; k < misfit.rows(); ++k)
      *residual++ *= weights.of_row[k] / std::sqrt(inflation);
    for (std::size_t k = 0; k < free.size(); ++k) *residual++ = given[0][k];
    return true;
  }
};

Result<Eigen::VectorXd> solved(const Misfit& misfit, const PowerParameters& parameters,
                               const Weights& weights, double inflation,
                               const std::vector<Eigen::Index>& free, const Eigen::VectorXd& start) {
  std::vector<double> values;
  for (const Eigen::Index k : free) values.push_back(start[k]);
  ceres::Problem problem;
  auto* cost = new ceres::DynamicNumericDiffCostFunction<Residuals, ceres::CENTRAL>(
      new Residuals{misfit, weights, inflation, free, start});
  cost->AddParameterBlock(static_cast<int>(free.size()));
  cost->SetNumResiduals(static_cast<int>(misfit.rows()) + static_cast<int>(free.size()));
  problem.AddResidualBlock(cost, nullptr, values.data());
  for (std::size_t k = 0; k < free.size(); ++k) {
    const auto p = static_cast<PowerParameter>(free[k]);
    const double least = parameters.least(p), most = parameters.most(p);
    if (std::isfinite(least)) problem.SetParameterLowerBound(values.data(), static_cast<int>(k), least);
    if (std::isfinite(most)) problem.SetParameterUpperBound(values.data(), static_cast<int>(k), most);
    values[k] = std::clamp(values[k], least, most);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = steps_a_round;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable())
    return fail(Fault::infeasible, "runs", "the fit to battery power found no parameters: " + summary.message);
  Eigen::VectorXd x = start;
  for (std::size_t k = 0; k < free.size(); ++k) x[free[k]] = values[k];
  return x;
}

// Sums of scores over blocks, a row each, about their mean.
Eigen::MatrixXd scores(const Misfit& misfit, const Eigen::MatrixXd& weighted, const Eigen::VectorXd& left) {
  std::map<std::size_t, Eigen::VectorXd> by_block;
  for (Eigen::Index k = 0; k < left.size(); ++k) {
    auto& sum = by_block.try_emplace(misfit.window(k).block, Eigen::VectorXd::Zero(parameter_count))
                    .first->second;
    sum += left[k] * weighted.row(k).transpose();
  }
  Eigen::MatrixXd all(static_cast<Eigen::Index>(by_block.size()), parameter_count);
  Eigen::Index row = 0;
  for (const auto& [block, score] : by_block) all.row(row++) = score.transpose();
  all.rowwise() -= all.colwise().mean().eval();
  return all;
}

// What the data say and how surely, at the parameters that were found.
void judge(const Misfit& misfit, const PowerParameters& parameters, const Weights& weights, PowerFit& fit) {
  const Eigen::MatrixXd j = weights.of_row.asDiagonal() * misfit.slopes(fit.x);
  const Eigen::VectorXd left = weights.of_row.cwiseProduct(misfit.left(fit.x));
  const Eigen::MatrixXd information = j.transpose() * j;
  const Eigen::MatrixXd score = scores(misfit, j, left);
  const auto blocks = static_cast<double>(score.rows());
  const double few = blocks > 1 ? blocks / (blocks - 1) : 1;
  const Eigen::MatrixXd scatter = few * score.transpose() * score;
  double ratio = 0, count = 0;
  for (Eigen::Index p = 0; p < parameter_count; ++p) {
    if (!(information(p, p) > 0)) continue;
    ratio += scatter(p, p) / information(p, p);
    ++count;
  }
  fit.inflation = count > 0 ? std::max(1.0, ratio / count) : 1;
  fit.information = information / fit.inflation;
  fit.spread_w = weights.spread_w;
  std::vector<Eigen::Index> known;
  for (Eigen::Index p = 0; p < parameter_count; ++p)
    if (parameters.expected(static_cast<PowerParameter>(p)) > 0) known.push_back(p);
  const auto n = static_cast<Eigen::Index>(known.size());
  const Eigen::MatrixXd prior = Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd covariance = (fit.information(known, known) + prior).inverse();
  const Eigen::MatrixXd middle = scatter(known, known) / (fit.inflation * fit.inflation) + prior;
  const Eigen::MatrixXd own = covariance * middle * covariance;
  fit.deviation = Eigen::VectorXd::Zero(parameter_count);
  for (Eigen::Index k = 0; k < n; ++k)
    fit.deviation[known[static_cast<std::size_t>(k)]] = std::sqrt(std::max(covariance(k, k), own(k, k)));
}

}  // namespace

Result<PowerFit> fit_power(const PowerParameters& parameters, const PowerWindows& data,
                           const std::function<bool(std::size_t block)>& use, const PowerFree& free,
                           const Eigen::VectorXd& start) {
  const Misfit misfit(parameters, data, use);
  if (misfit.rows() == 0) return invalid("runs", "hold no window with battery power in which wheels keep moving or still");
  std::vector<Eigen::Index> moved;
  for (std::size_t p = 0; p < power_parameter_count; ++p)
    if (free[p] && parameters.expected(static_cast<PowerParameter>(p)) > 0)
      moved.push_back(static_cast<Eigen::Index>(p));
  const double power_w = scale_of(data.windows).power_w;
  PowerFit fit{start, {}, {}, 1, 0};
  Weights weights;
  for (int round = 0; round < most_rounds; ++round) {
    weights = weigh(misfit, misfit.left(fit.x), power_w);
    const auto next = solved(misfit, parameters, weights, fit.inflation, moved, fit.x);
    if (!next) return tl::unexpected(next.error());
    const double change = (*next - fit.x).cwiseAbs().maxCoeff();
    fit.x = *next;
    judge(misfit, parameters, weights, fit);
    if (change < settled) break;
  }
  return fit;
}

}  // namespace joulecast::energy
