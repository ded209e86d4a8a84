#include "gap/posterior/gram.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace joulecast::gap::posterior {

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
