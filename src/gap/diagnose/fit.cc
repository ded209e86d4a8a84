#include "gap/diagnose/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/equations/zone_scan.h"

namespace joulecast::gap {
namespace {

constexpr int most_rounds = 14, most_halvings = 3;
constexpr double settled = 0.02;      // relative change of every coefficient
constexpr double first_factor = 1.5;  // between neighbouring shapes, narrowed with every round
constexpr double worse = 1.02;        // misfit, over the one before

std::vector<Chosen> chosen_of(const ColumnSet& columns, const Explanation& explanation) {
  std::vector<Chosen> chosen;
  for (const Member& m : explanation.members) {
    if (columns.hypotheses()[m.hypothesis].is_effect()) chosen.push_back({m.hypothesis, m.coefficients});
  }
  return chosen;
}

bool same(std::span<const dynamics::ActiveEffect> a, std::span<const dynamics::ActiveEffect> b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) {
    if (x.effect != y.effect) return false;
    for (std::size_t k = 0; k < x.values.size(); ++k) {
      if (std::fabs(x.values[k] - y.values[k]) > settled * std::fabs(x.values[k]) + 1e-12) return false;
    }
    return true;
  });
}

// Where on the floor something brakes, if anything does.
std::optional<Zone> zone_of(const Material& m, std::span<const double> shares) {
  if (!ranges_of(m.windows, m.robot).position) return std::nullopt;
  Shapes scan;
  scan.zones = {everywhere};
  const Linear linear = linearise(m, scan, shares, {});
  return find_zone(*linear.columns, linear.rows, linear.noise, m.windows);
}

}  // namespace

std::optional<FitResult> fit_windows(const Material& whole, std::span<const dynamics::ActiveEffect> start,
                                     const FitSettings& settings, const std::function<bool()>& goes_on) {
  const std::vector<Window> some = thinned(whole.windows);
  Material material = whole;
  material.windows = some;
  FitResult result;
  if (const auto zone = zone_of(material, settings.shares)) result.shapes.zones = {*zone};
  for (const dynamics::ActiveEffect& effect : start)
    result.shapes.narrow(effect, material.robot.kinematics.wheel_radius_m, first_factor);
  if (!goes_on()) return std::nullopt;
  ExplainSettings quick = settings.explain;
  quick.predictive = false;
  std::optional<Noise> first_noise;
  double reached = std::numeric_limits<double>::infinity(), factor = first_factor;
  std::vector<dynamics::ActiveEffect> next(start.begin(), start.end());
  for (int round = 0, halved = 0; round < most_rounds; ++round) {
    Linear linear = linearise(material, result.shapes, settings.shares, next);
    if (!goes_on()) return std::nullopt;
    if (!first_noise) first_noise = linear.noise;
    // A step that leads further away was too long for what is linear.
    const double now = misfit(linear, *first_noise);
    if (now > worse * reached) {
      if (++halved > most_halvings) break;
      next = half_way(result.effects, std::move(next));
      continue;
    }
    halved = 0;
    reached = std::min(reached, now);
    result.linear = std::move(linear);
    result.effects = next;
    const Problem problem = make_problem(*result.linear.columns, result.linear.rows, result.linear.noise, material.blocks);
    const Mixture mixture(problem);
    const Explanation explanation = explain(mixture, {}, quick);
    result.log_joint = mixture.log_joint(explanation.whole);
    next = result.linear.columns->effects_of(chosen_of(*result.linear.columns, explanation));
    result.rests = same(next, result.effects);
    if (result.rests) break;
    for (const dynamics::ActiveEffect& effect : next)
      result.shapes.narrow(effect, material.robot.kinematics.wheel_radius_m, factor);
    factor = std::sqrt(factor);
  }
  if (some.size() < whole.windows.size())
    result.linear = linearise(whole, result.shapes, settings.shares, result.effects);
  return result;
}

}  // namespace joulecast::gap
