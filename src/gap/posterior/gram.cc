#include "gap/posterior/gram.h"

#include <algorithm>
#include <cmath>
#include <numeric>

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

double size_of(std::vector<double> residual, bool by_squares) {
  double squares = 0;
  for (double& e : residual) {
    squares += e * e;
    e = std::fabs(e);
  }
  return by_squares ? std::sqrt(squares / static_cast<double>(residual.size()))
                    : 1.4826 * statistics::median(std::move(residual));
}

Eigen::VectorXd spreads(const ChannelRows& rows, const Eigen::VectorXd& residual, bool by_squares) {
  const double all = std::max(size_of({residual.begin(), residual.end()}, by_squares), 1e-12);
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
    found.push_back(values.size() < fewest_of_class ? missing : size_of(std::move(values), by_squares));
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
  const Eigen::VectorXd sizes = residual.cwiseAbs();
  noise.rest = sizes.mean();
  // A channel that follows a formula to the last digit was computed: it is no measurement.
  if (statistics::median({sizes.begin(), sizes.end()}) < 1e-6 * size) return noise;
  weight /= n / std::max(n + freedom, 0.1 * n);  // the fit reduces the residuals by its degrees of freedom
  noise.inflation = block_inflation(rows, weight.cwiseProduct(residual).asDiagonal() * x);
  noise.weight = weight / noise.inflation;
  noise.sigma = statistics::median({spread.begin(), spread.end()});
  return noise;
}

Grams make_grams(const Equations& e, std::span<const Noise> noise, std::size_t blocks) {
  Grams grams;
  grams.raw.assign(blocks, Information(ix(e.size())));
  for (std::size_t c = 0; c < e.channels.size(); ++c) {
    if (!(noise[c].sigma > 0)) continue;
    const ChannelRows& rows = e.channels[c];
    std::vector<std::vector<Eigen::Index>> of_block(blocks);
    for (std::size_t k = 0; k < rows.block.size(); ++k) of_block[rows.block[k]].push_back(ix(k));
    const Eigen::VectorXd root = noise[c].weight.cwiseSqrt();
    for (std::size_t b = 0; b < blocks; ++b) {
      if (of_block[b].empty()) continue;
      const Eigen::VectorXd own = root(of_block[b]);
      const Eigen::MatrixXd x = own.asDiagonal() * rows.x(of_block[b], Eigen::all);
      grams.raw[b].add(x, own.cwiseProduct(rows.y(of_block[b])), rows.columns);
    }
  }
  Eigen::VectorXd scatter(ix(e.size()));
  for (std::size_t k = 0; k < e.size(); ++k) scatter[ix(k)] = e.columns[k].scatter;
  for (std::size_t f = 0; f < factor_count; ++f) {
    grams.of_factor[f] = grams.raw;
    const double factor = std::min(tolerance_factors[f], most_scatter_factor);
    for (Information& block : grams.of_factor[f]) block.integrate_out(factor * scatter);
  }
  return grams;
}

Eigen::VectorXd tolerances(const Equations& e, double factor) {
  Eigen::VectorXd sd(ix(e.size()));
  for (std::size_t k = 0; k < e.size(); ++k) {
    const Column& c = e.columns[k];
    sd[ix(k)] = (c.of_file ? factor : std::min(factor, most_function_factor)) * c.tolerance;
  }
  return sd;
}

std::vector<Eigen::Index> without_functions(const Equations& e) {
  std::vector<Eigen::Index> keep(e.size());
  std::iota(keep.begin(), keep.end(), Eigen::Index{0});
  keep.erase(keep.begin() + ix(e.effects), keep.begin() + ix(e.effects + e.functions));
  return keep;
}

Information weighted_sum(std::span<const Information> blocks, std::span<const double> weights) {
  Information sum;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (weights[b] == 0) continue;
    Information part = blocks[b];
    part *= weights[b];
    sum += part;
  }
  return sum;
}

Information subset(const Information& information, std::span<const Eigen::Index> keep) {
  const std::vector<Eigen::Index> own(keep.begin(), keep.end());
  Information part;
  part.xx = information.xx(own, own);
  part.xy = information.xy(own);
  part.yy = information.yy;
  part.log_scale = information.log_scale;
  return part;
}

ReducedByFactor reduce(const Equations& e, const Grams& grams, std::span<const double> weights) {
  std::vector<Eigen::Index> keep(e.effects + e.functions);
  std::iota(keep.begin(), keep.end(), Eigen::Index{0});
  ReducedByFactor out;
  for (std::size_t f = 0; f < factor_count; ++f) {
    Information all = weighted_sum(grams.of_factor[f], weights);
    all.integrate_out(tolerances(e, tolerance_factors[f]));
    out[f].information = subset(all, keep);
    out[f].log_evidence = all.log_scale - 0.5 * all.yy + std::log(std::max(e.factor_prior[f], 1e-300));
  }
  return out;
}

}  // namespace joulecast::gap::posterior
