#include "gap/naming.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "gap/held_out.h"
#include "gap/power_gap.h"

namespace joulecast::gap {
namespace {

constexpr double least_necessary_part = 0.05;  // of the gap, that comes back when an effect is left out
constexpr double alternative_odds = 0.04;
constexpr std::size_t most_alternatives = 2;
constexpr double least_deviations = 1.64;
constexpr double formula_accuracy = 0.015;
constexpr double calibration_share = 0.5;

struct Alternative {
  const dynamics::Effect* effect;
  double odds;
};

// Effects that would explain the data nearly as well in the place of one of the set.
std::vector<Alternative> alternatives_to(const Fit& fit, const std::vector<std::size_t>& set,
                                         std::size_t member) {
  const auto& all = fit.columns->hypotheses();
  const double reference = fit.evidence->log_odds(set);
  std::map<const dynamics::Effect*, double> best;
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (all[h].outside() || all[h].effect.effect == all[member].effect.effect) continue;
    if (std::ranges::any_of(set, [&](std::size_t o) { return all[o].effect.effect == all[h].effect.effect; }))
      continue;
    std::vector<std::size_t> other = set;
    std::ranges::replace(other, member, h);
    std::ranges::sort(other);
    const double odds = std::exp(std::min(50.0, fit.evidence->log_odds(other) - reference));
    double& kept = best[all[h].effect.effect];
    kept = std::max(kept, odds);
  }
  std::vector<Alternative> result;
  for (const auto& [effect, odds] : best) {
    if (odds > alternative_odds) result.push_back({effect, odds});
  }
  std::ranges::sort(result, std::greater{}, &Alternative::odds);
  return result;
}

std::vector<DiagnosedParameter> parameters_of(const ColumnSet& columns, const Chosen& chosen,
                                              const Evidence::Estimate& estimate) {
  const Hypothesis& h = columns.hypotheses()[chosen.hypothesis];
  const dynamics::ActiveEffect active = columns.effects_of({&chosen, 1}).front();
  std::vector<DiagnosedParameter> parameters;
  const auto& info = active.effect->info().parameters;
  for (std::size_t k = 0; k < info.size(); ++k) {
    parameters.push_back({std::string(info[k].name), std::string(info[k].unit), active.values[k], missing});
  }
  const auto sd = [&](std::size_t j) { return estimate.sd[static_cast<Eigen::Index>(j)]; };
  if (h.columns.size() == 2) {
    const double a = sd(h.columns[0]), b = sd(h.columns[1]);
    const double c = std::cos(active.values[1]), s = std::sin(active.values[1]);
    parameters[0].deviation = std::hypot(c * a, s * b);
    parameters[1].deviation = std::hypot(s * a, c * b) / std::max(active.values[0], 1e-9);
  } else {
    parameters[h.parameter].deviation = sd(h.columns[0]);
  }
  // What the equations say of the strength, how far the formula holds, and what calibration alone may hold.
  parameters[h.parameter].deviation =
      std::hypot(parameters[h.parameter].deviation, formula_accuracy * active.values[h.parameter],
                 calibration_share * columns.columns()[h.columns[0]].tolerance);
  return parameters;
}

// Effects that act on power but are not needed for it: leaving them out and fitting the others again hardly
// opens the gap. What they describe is the shape of the others.
std::vector<std::size_t> necessary(const Fit& fit, const robot::RobotModel& robot,
                                   std::vector<std::size_t> set, std::span<const Window> windows,
                                   std::span<const double> measured, double power_gap) {
  const ColumnSet& columns = *fit.columns;
  const auto gap_with = [&](const std::vector<std::size_t>& some) {
    const auto effects = columns.effects_of(coefficients_of(fit, fit.total, some));
    return gap_size(measured, modelled_power(robot, effects, windows)).absolute_relative;
  };
  const auto named = [&](std::size_t h) { return !columns.hypotheses()[h].outside(); };
  // A strength that its own uncertainty reaches round is no finding, however the odds stand.
  const Evidence::Estimate estimate = fit.evidence->estimate(set);
  std::erase_if(set, [&](std::size_t h) {
    return named(h) && std::ranges::all_of(columns.hypotheses()[h].columns, [&](std::size_t k) {
             const auto j = static_cast<Eigen::Index>(k);
             return std::fabs(estimate.mean[j]) < least_deviations * estimate.sd[j];
           });
  });
  while (std::ranges::count_if(set, named) > 1) {
    const double with_all = gap_with(set);
    double least = least_necessary_part * power_gap;
    auto spare = set.end();
    for (auto it = set.begin(); it != set.end(); ++it) {
      const Hypothesis& h = columns.hypotheses()[*it];
      if (h.outside() || !shows_in_power(h.id())) continue;
      std::vector<std::size_t> others = set;
      std::erase(others, *it);
      const double opened = gap_with(others) - with_all;
      if (opened < least) {
        least = opened;
        spare = it;
      }
    }
    if (spare == set.end()) break;
    set.erase(spare);
  }
  return set;
}

}  // namespace

Naming name_effects(const Fit& fit, const Posterior& posterior, const MovedShares& moved,
                    const robot::RobotModel& robot, std::span<const Window> windows,
                    std::span<const double> measured, double power_gap) {
  const ColumnSet& columns = *fit.columns;
  const auto& hypotheses = columns.hypotheses();
  const auto best =
      std::ranges::max_element(posterior.sets, {}, [](const auto& entry) { return entry.second; });
  Naming naming;
  naming.whole = best->first;
  naming.set = necessary(fit, robot, best->first, windows, measured, power_gap);
  naming.chosen = coefficients_of(fit, fit.total, naming.set);
  naming.effects = columns.effects_of(naming.chosen);

  const Evidence::Estimate whole = fit.evidence->estimate(naming.whole);
  for (const std::size_t h : naming.whole) {
    if (!hypotheses[h].outside()) naming.to_and_fro_share += moved(hypotheses[h], whole.mean);
  }
  const Evidence::Estimate estimate = fit.evidence->estimate(naming.set);
  for (const std::size_t k : naming.set) {
    const Hypothesis& h = hypotheses[k];
    const double share = moved(h, estimate.mean);
    (h.outside() ? naming.unknown_share : naming.named_share) += share;
    if (!h.outside() || (naming.unknown && share <= naming.largest_unknown_share)) continue;
    naming.unknown = k;
    naming.largest_unknown_share = share;
  }
  for (const Chosen& chosen : naming.chosen) {
    const Hypothesis& h = hypotheses[chosen.hypothesis];
    DiagnosedEffect effect;
    effect.id = h.id();
    effect.probability = posterior.of_effect(columns, h.effect.effect);
    effect.parameters = parameters_of(columns, chosen, estimate);
    double group = effect.probability;
    for (const Alternative& other : alternatives_to(fit, naming.set, chosen.hypothesis)) {
      if (effect.alternatives.size() >= most_alternatives) break;
      effect.alternatives.emplace_back(other.effect->info().id);
      group += posterior.of_effect(columns, other.effect);
    }
    naming.weakest_group = std::min(naming.weakest_group, group);
    naming.named.push_back(std::move(effect));
  }
  return naming;
}

void name_burning_slip(std::vector<DiagnosedEffect>& effects) {
  constexpr double least_slip = 0.015, alike = 0.35;
  const auto wheel = std::ranges::find(effects, "wheel_radius_error", &DiagnosedEffect::id);
  if (wheel != effects.end() && wheel->parameters[0].value < 0 &&
      std::ranges::find(wheel->alternatives, "wheel_slip") == wheel->alternatives.end()) {
    // How far slip burns what passes depends on the contact: the motion alone cannot refute it.
    wheel->alternatives.insert(wheel->alternatives.begin(), "wheel_slip");
    wheel->alternatives.resize(std::min(wheel->alternatives.size(), most_alternatives));
  }
  const auto gear = std::ranges::find(effects, "gear_efficiency", &DiagnosedEffect::id);
  if (wheel == effects.end() || gear == effects.end()) return;
  const double slip = -wheel->parameters[0].value, loss = gear->parameters[0].value;
  if (slip < least_slip || std::fabs(loss - slip) > alike * slip) return;
  DiagnosedEffect named = *wheel;
  named.id = "wheel_slip";
  named.parameters = {{"slip", "1", slip, wheel->parameters[0].deviation}};
  named.probability = std::min(wheel->probability, gear->probability);
  named.share = wheel->share + gear->share;
  named.alternatives = {"wheel_radius_error", "gear_efficiency"};
  std::erase_if(effects, [](const DiagnosedEffect& e) {
    return e.id == "wheel_radius_error" || e.id == "gear_efficiency";
  });
  effects.push_back(std::move(named));
}

}  // namespace joulecast::gap
