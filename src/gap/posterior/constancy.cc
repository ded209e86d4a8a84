#include "gap/posterior/constancy.h"

#include <cmath>
#include <numeric>

namespace joulecast::gap::posterior {

Constancy constancy(const Fit& fit, std::span<const std::size_t> set, std::size_t member) {
  const Equations& e = fit.equations;
  // Functions are left out.
  std::vector<Eigen::Index> keep(e.size());
  std::iota(keep.begin(), keep.end(), Eigen::Index{0});
  std::erase_if(keep, [&](Eigen::Index k) { return k >= ix(e.effects) && k < ix(e.effects + e.functions); });
  std::vector<Information> blocks;
  for (const Information& block : fit.grams.raw) blocks.push_back(subset(block, keep));
  const Eigen::VectorXd tolerance = tolerances(e, tolerance_factors[0])(keep);
  Eigen::VectorXd scatter(ix(e.size()));
  for (std::size_t k = 0; k < e.size(); ++k) scatter[ix(k)] = e.columns[k].scatter;
  const double strength = std::fabs(
      View(*fit.prior, fit.reduced[fit.factor]).evidence(set, std::nullopt, slab_shares).mean[ix(member)]);
  std::array<double, wander_scales.size()> log_joint{};
  for (std::size_t r = 0; r < wander_scales.size(); ++r) {
    Eigen::VectorXd own = scatter;
    for (const std::size_t k : fit.catalogue.hypotheses[set[member]].columns)
      own[ix(k)] = std::hypot(own[ix(k)], wander_scales[r] * strength);
    Information sum;
    for (Information block : blocks) {
      block.integrate_out(own(keep));
      sum += block;
    }
    sum.integrate_out(tolerance);
    const Reduced reduced{std::move(sum), 0};
    const double prior =
        r == 0 ? constant_prior : (1 - constant_prior) / static_cast<double>(wander_scales.size() - 1);
    log_joint[r] = reduced.information.log_scale - 0.5 * reduced.information.yy + std::log(prior) +
                   View(*fit.prior, reduced).evidence(set, std::nullopt, slab_shares).log_evidence;
  }
  const double most = *std::ranges::max_element(log_joint);
  double all = 0, constant = 0, scattered = 0;
  for (std::size_t r = 0; r < wander_scales.size(); ++r) {
    const double weight = std::exp(log_joint[r] - most);
    all += weight;
    scattered += wander_scales[r] * weight;
    if (wander_scales[r] <= most_wander) constant += weight;
  }
  return {constant / all, scattered / all};
}

}  // namespace joulecast::gap::posterior
