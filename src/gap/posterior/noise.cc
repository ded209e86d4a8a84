#include "gap/posterior/noise.h"

#include <algorithm>
#include <cmath>

#include "gap/posterior/constants.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::gap::posterior {
namespace {

// Standard deviations of the coefficients in the ridge fit; 0 leaves a column out.
Eigen::VectorXd ridge_deviations(const ChannelRows& rows, const Equations& e,
                                 const std::vector<Function>& functions) {
  Eigen::VectorXd sd(ix(e.size()));
  for (std::size_t k = 0; k < e.size(); ++k) {
    const Column& c = e.columns[k];
    const double unit = c.usual > 0 ? std::min(c.unit, c.usual / likely_share) : c.unit;
    sd[ix(k)] = std::max({c.tolerance, c.scatter, likely_share * unit});
  }
  for (std::size_t f = 0; f < functions.size(); ++f)
    for (const std::size_t k : e.function_columns[f]) sd[ix(k)] = functions[f].for_noise ? sd[ix(k)] : 0;
  return sd(rows.columns);
}

double size_of(const std::vector<double>& residual, bool by_squares) {
  if (by_squares) {
    double sum = 0;
    for (const double e : residual) sum += e * e;
    return std::sqrt(sum / static_cast<double>(residual.size()));
  }
  std::vector<double> sizes(residual.size());
  std::ranges::transform(residual, sizes.begin(), [](double e) { return std::fabs(e); });
  return 1.4826 * statistics::median(std::move(sizes));
}

Eigen::VectorXd spreads(const ChannelRows& rows, const Eigen::VectorXd& residual, bool by_squares) {
  const std::vector<double> all_residuals(residual.begin(), residual.end());
  const double all = std::max(size_of(all_residuals, by_squares), 1e-12);
  std::vector<Eigen::Index> moving;
  std::vector<std::vector<Eigen::Index>> classes(1);
  for (Eigen::Index k = 0; k < residual.size(); ++k) (rows.resting[ux(k)] ? classes[0] : moving).push_back(k);
  std::ranges::stable_sort(moving, {}, [&](Eigen::Index k) { return std::fabs(rows.y[k] - residual[k]); });
  const std::size_t many = std::clamp<std::size_t>(moving.size() / (2 * fewest_of_class), 1, size_classes);
  for (std::size_t g = 0; g < many; ++g)
    classes.emplace_back(moving.begin() + static_cast<std::ptrdiff_t>(g * moving.size() / many),
                         moving.begin() + static_cast<std::ptrdiff_t>((g + 1) * moving.size() / many));
  std::vector<double> found;
  double most = 0;
  for (const auto& own : classes) {
    std::vector<double> values;
    for (const Eigen::Index k : own) values.push_back(residual[k]);
    found.push_back(values.size() < fewest_of_class ? missing : size_of(values, by_squares));
    if (std::isfinite(found.back())) most = std::max(most, found.back());
  }
  if (most == 0) most = all;
  Eigen::VectorXd spread = Eigen::VectorXd::Constant(residual.size(), all);
  for (std::size_t g = 0; g < classes.size(); ++g) {
    for (const Eigen::Index k : classes[g])
      spread[k] = std::max({std::isfinite(found[g]) ? found[g] : most, least_spread * most, 1e-12});
  }
  return spread;
}

// Mean over the columns of the ratio of the scatter of blocks' scores to that of independent rows.
double block_inflation(const ChannelRows& rows, const Eigen::MatrixXd& scores) {
  const Eigen::MatrixXd sums = statistics::block_sums(scores, rows.block);
  if (ux(sums.rows()) < fewest_blocks) return 1;
  const Eigen::VectorXd naive = scores.cwiseAbs2().colwise().sum();
  const Eigen::VectorXd clustered = sums.cwiseAbs2().colwise().sum();
  double ratio = 0, count = 0;
  for (Eigen::Index j = 0; j < naive.size(); ++j) {
    if (naive[j] <= 1e-12 * naive.maxCoeff()) continue;
    ratio += clustered[j] / naive[j];
    count += 1;
  }
  const double blocks = static_cast<double>(sums.rows());
  return count > 0 ? std::max(1.0, ratio / count * blocks / (blocks - 1)) : 1;
}

}  // namespace

Noise learn_noise(const ChannelRows& rows, const Equations& e, const std::vector<Function>& functions) {
  Noise noise;
  const bool by_squares = rows.channel == Channel::power;
  const Eigen::VectorXd sd = ridge_deviations(rows, e, functions);
  std::vector<Eigen::Index> used;
  for (Eigen::Index k = 0; k < sd.size(); ++k)
    if (sd[k] > 0) used.push_back(k);
  const Eigen::MatrixXd x = rows.x(Eigen::all, used) * sd(used).asDiagonal();
  const double n = static_cast<double>(rows.y.size()), size = std::sqrt(rows.y.squaredNorm() / n);
  Eigen::VectorXd weight = Eigen::VectorXd::Constant(rows.y.size(), 1 / (size * size)), residual, spread;
  double freedom = 0;
  for (int pass = 0; pass < 3; ++pass) {
    const Eigen::MatrixXd weighted = weight.asDiagonal() * x;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(x.cols(), x.cols());
    normal.triangularView<Eigen::Lower>() += weighted.transpose() * x;
    const Eigen::LLT<Eigen::MatrixXd> factor(normal.selfadjointView<Eigen::Lower>());
    residual = rows.y - x * factor.solve(weighted.transpose() * rows.y);
    spread = spreads(rows, residual, by_squares);
    for (Eigen::Index k = 0; k < weight.size(); ++k) {
      const double huber = by_squares ? 1 : statistics::huber_weight(residual[k], spread[k], outlier);
      weight[k] = huber / (spread[k] * spread[k]);
    }
    if (pass == 2)
      freedom =
          factor.solve(Eigen::MatrixXd::Identity(x.cols(), x.cols())).trace() - static_cast<double>(x.cols());
  }
  std::vector<double> sizes(residual.begin(), residual.end()), all(spread.begin(), spread.end());
  std::ranges::transform(sizes, sizes.begin(), [](double v) { return std::fabs(v); });
  noise.rest = residual.cwiseAbs().mean();
  // A channel that follows a formula to the last digit was computed: it is no measurement.
  if (statistics::median(std::move(sizes)) < 1e-6 * size) return noise;
  weight /= n / std::max(n + freedom, 0.1 * n);  // the fit reduces the residuals by its degrees of freedom
  noise.inflation = block_inflation(rows, weight.cwiseProduct(residual).asDiagonal() * x);
  noise.weight = weight / noise.inflation;
  noise.sigma = statistics::median(std::move(all));
  return noise;
}

}  // namespace joulecast::gap::posterior
