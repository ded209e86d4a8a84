#include "gap/diagnose/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/equations/zone_scan.h"

namespace joulecast::gap {
namespace {

constexpr int max_fit_rounds = 14, max_fit_halvings = 3;
constexpr double fit_tolerance = 0.02;  // relative change of every coefficient
constexpr double first_factor = 1.5;    // between neighbouring shapes, narrowed with every round
constexpr double worse = 1.02;          // misfit, over the one before

std::vector<Chosen> chosen_of(const ColumnSet& columns, const Explanation& explanation) {
  std::vector<Chosen> chosen;
  for (const Member& m : explanation.members) {
    if (!columns.hypotheses()[m.hypothesis].outside()) chosen.push_back({m.hypothesis, m.coefficients});
  }
  return chosen;
}

bool same(std::span<const Cause> a, std::span<const Cause> b) {
  return std::ranges::equal(a, b, [](const Cause& x, const Cause& y) {
    if (!x.same_kind(y)) return false;
    for (std::size_t k = 0; k < x.effect.values.size(); ++k) {
      const double here = x.effect.values[k], there = y.effect.values[k];
      if (std::fabs(here - there) > fit_tolerance * std::fabs(here) + 1e-12) return false;
    }
    return true;
  });
}

void narrow(Shapes& shapes, std::span<const Cause> causes, const robot::RobotModel& robot, double factor) {
  for (const Cause& cause : causes) shapes.narrow(cause.effect, robot.kinematics.wheel_radius_m, factor);
}

}  // namespace

ZoneScan::ZoneScan(const Material& m, std::span<const double> shares) : windows_(thinned(m.windows)) {
  Material thin = m;
  thin.windows = windows_;
  Shapes scan;
  scan.zones = {everywhere};
  linear_ = linearise(thin, scan, shares, {});
}

std::optional<Zone> ZoneScan::without(const std::vector<bool>& left_out) const {
  if (left_out.empty()) return find_zone(*linear_.columns, linear_.rows, linear_.noise, windows_);
  const Noise noise = learn_noise(*linear_.columns, linear_.rows, left_out);
  return find_zone(*linear_.columns, linear_.rows, noise, windows_);
}

Material based(const Material& material, const FitResult& fit) {
  Material m = material;
  if (!fit.base.empty()) m.adopted = fit.in_force;
  return m;
}

std::optional<FitResult> fit_windows(const Material& whole, std::span<const Cause> start,
                                     const FitSettings& settings, const std::function<bool()>& goes_on) {
  const std::vector<Window> some = thinned(whole.windows);
  Material material = whole;
  material.windows = some;
  FitResult result;
  if (ranges_of(material.windows, material.robot).position) {
    result.zones.emplace(material, settings.shares);
    if (const auto zone = result.zones->without({})) result.shapes.zones = {*zone};
  }
  narrow(result.shapes, start, material.robot, first_factor);
  if (!goes_on()) return std::nullopt;
  ExplainSettings quick = settings.explain;
  quick.predictive = false;
  std::optional<Noise> first_noise;
  double reached = std::numeric_limits<double>::infinity(), factor = first_factor;
  std::vector<Cause> next(start.begin(), start.end());
  for (int round = 0, halved = 0; round < max_fit_rounds; ++round) {
    Linear linear = linearise(material, result.shapes, settings.shares, next);
    if (!goes_on()) return std::nullopt;
    if (!first_noise) first_noise = linear.noise;
    // A step that leads further away was too long for what is linear.
    const double now = misfit(linear, *first_noise);
    if (now > worse * reached) {
      if (++halved > max_fit_halvings) break;
      next = half_way(result.causes, std::move(next));
      continue;
    }
    halved = 0;
    reached = std::min(reached, now);
    result.linear = std::move(linear);
    result.causes = next;
    const Problem problem =
        make_problem(*result.linear.columns, result.linear.rows, result.linear.noise, material.blocks);
    const Mixture mixture(problem);
    const Explanation explanation = explain(mixture, {}, quick);
    result.log_joint = mixture.log_joint(explanation.whole);
    if (!settings.again) break;
    next = result.linear.columns->causes_of(chosen_of(*result.linear.columns, explanation));
    if (same(next, result.causes)) break;
    narrow(result.shapes, next, material.robot, factor);
    factor = std::sqrt(factor);
  }
  if (some.size() < whole.windows.size())
    result.linear = linearise(whole, result.shapes, settings.shares, result.causes);
  return result;
}

}  // namespace joulecast::gap
