#include "gap/diagnose/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/diagnose/referee.h"
#include "gap/equations/power.h"
#include "gap/equations/zone_scan.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_parts = 6;

// Which blocks belong to a part.
std::vector<bool> blocks_of(std::size_t part, std::size_t parts, std::size_t blocks) {
  std::vector<bool> out(blocks);
  for (std::size_t b = 0; b < blocks; ++b) out[b] = b * parts / blocks == part;
  return out;
}

// The same point of linearisation with a zone more for each part, where the rest of the floor says that one is. In the
// order of the parts; a part without its own zone has the first.
Linear with_zones(const Material& m, const FitResult& fit, const FitSettings& settings, std::size_t parts,
                  std::vector<std::size_t>& zone_of_part) {
  Shapes scan, shapes = fit.shapes;
  scan.zones = {everywhere};
  const std::vector<Window> some = thinned(m.windows);
  Material thin = m;
  thin.windows = some;
  const Linear linear = linearise(thin, scan, settings.shares, {});
  for (std::size_t part = 0; part < parts; ++part) {
    const Noise noise = learn_noise(*linear.columns, linear.rows, blocks_of(part, parts, m.blocks));
    const auto zone = find_zone(*linear.columns, linear.rows, noise, some);
    zone_of_part.push_back(zone ? shapes.zones.size() : 0);
    if (zone) shapes.zones.push_back(*zone);
  }
  return linearise(m, shapes, settings.shares, fit.effects);
}

// Only one of the zones may be there; the others were found with other parts left out.
void keep_zone(Problem& problem, std::size_t zone, std::size_t scales) {
  constexpr double never = -1e6;
  std::size_t seen = 0;
  for (Hypothesis& h : problem.hypotheses) {
    if (h.id() == "floor_resistance_zone" && seen++ / scales != zone) h.candidate.log_prior += never;
  }
}

}  // namespace

double HeldOut::relative(double BlockErrors::*error) const {
  double sum = 0, size = 0;
  for (const BlockErrors& b : blocks) {
    sum += b.*error;
    size += b.size;
  }
  return size > 0 ? sum / size : std::numeric_limits<double>::quiet_NaN();
}

HypothesisSet named_effects(const Problem& problem, const Explanation& explanation) {
  HypothesisSet named;
  for (const Member& m : explanation.members) {
    if (problem.hypotheses[m.hypothesis].is_effect() && m.group_probability() >= least_named && m.wander < most_wander)
      named.push_back(m.hypothesis);
  }
  std::ranges::sort(named);
  return named;
}

std::vector<dynamics::ActiveEffect> strengths_of(const ColumnSet& columns, const Problem& problem,
                                                 const HypothesisSet& named, const std::vector<bool>& left_out) {
  if (named.empty()) return {};
  std::vector<std::size_t> own;
  for (const std::size_t h : named) {
    const auto& more = problem.hypotheses[h].candidate.columns;
    own.insert(own.end(), more.begin(), more.end());
  }
  std::ranges::sort(own);
  const Mixture::Estimate estimate = Mixture(problem, left_out, own).estimate(named);
  std::vector<Chosen> chosen;
  Eigen::Index at = 0;
  for (const std::size_t h : named) {
    Chosen c{h, {}};
    for (std::size_t k = 0; k < problem.hypotheses[h].candidate.columns.size(); ++k)
      c.coefficients.push_back(estimate.mean[at++]);
    chosen.push_back(std::move(c));
  }
  return columns.effects_of(chosen);
}

std::optional<HeldOut> hold_out(const Material& m, const FitResult& fit, std::span<const double> power_w,
                                const FitSettings& settings, const std::function<bool(double)>& goes_on) {
  HeldOut held;
  held.blocks.resize(m.blocks);
  held.parts = std::min(most_parts, m.blocks);
  std::vector<std::size_t> zone_of_part;
  std::optional<Linear> zoned;
  if (!fit.shapes.zones.empty()) zoned = with_zones(m, fit, settings, held.parts, zone_of_part);
  const Linear& linear = zoned ? *zoned : fit.linear;
  const std::vector<double> unchanged = modelled_power(m.robot, m.adopted, m.windows);
  for (std::size_t part = 0; part < held.parts; ++part) {
    const std::vector<bool> out = blocks_of(part, held.parts, m.blocks);
    const Noise noise = learn_noise(*linear.columns, linear.rows, out);
    Problem problem = make_problem(*linear.columns, linear.rows, noise, m.blocks);
    if (zoned) keep_zone(problem, zone_of_part[part], settings.shares.size());
    const Explanation explanation = explain(problem, out, settings.explain);
    const HypothesisSet named = named_effects(problem, explanation);
    std::vector<std::string> ids;
    for (const std::size_t h : named) ids.push_back(problem.hypotheses[h].id());
    held.named.push_back(std::move(ids));
    std::vector<dynamics::ActiveEffect> effects(m.adopted.begin(), m.adopted.end());
    for (const auto& effect : strengths_of(*linear.columns, problem, named, out)) effects.push_back(effect);
    const dynamics::DriveModel model(m.robot, effects);
    std::vector<bool> others(m.windows.size());
    for (std::size_t k = 0; k < m.windows.size(); ++k) others[k] = !out[m.windows[k].block];
    const Referee referee(m.windows, power_w, m.robot, others);
    for (std::size_t k = 0; k < m.windows.size(); ++k) {
      if (others[k] || !std::isfinite(power_w[k] + unchanged[k])) continue;
      BlockErrors& b = held.blocks[m.windows[k].block];
      b.unchanged += std::fabs(power_w[k] - unchanged[k]);
      b.explained += std::fabs(power_w[k] - metered_power(model, m.windows[k]));
      b.referee += std::fabs(power_w[k] - referee.predict(m.windows[k]));
      b.size += std::fabs(power_w[k]);
    }
    if (!goes_on(static_cast<double>(part + 1) / static_cast<double>(held.parts))) return std::nullopt;
  }
  return held;
}

}  // namespace joulecast::gap
