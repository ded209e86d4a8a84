#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/traits.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/answer.h"
#include "gap/verdict/text.h"
#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

using posterior::Explained;
using posterior::HeldOut;

// Whether every named effect is visible in other channels than power, so that held-out power is no test.
bool shown_elsewhere(const Diagnosis& d) {
  return d.verdict == Verdict::effects && std::ranges::all_of(d.effects, [](const DiagnosedEffect& e) {
           return dynamics::find_effect(e.id) != nullptr &&
                  (traits_of(e.id).elsewhere || std::ranges::any_of(e.parameters, [](const auto& p) {
                     return p.name == "battery" && p.value == 0;
                   }));
         });
}

std::string refusal_of(const Explained& answer, bool other_channels, const Diagnosis& d) {
  if (d.adoptable.empty() || (d.effects.empty() && d.verdict == Verdict::inconclusive))
    return "no change of the robot file was found";
  if (d.verdict == Verdict::outside)
    return fmt::format("a cause outside the catalogue has a probability of {}",
                       probability_text(d.outside.probability));
  const auto bound = std::ranges::find_if(answer.effects, &posterior::ExplainedBy::at_bound);
  if (bound != answer.effects.end())
    return fmt::format("{} = {} is at its bound", bound->id, brief(bound->parameters.front().value));
  const HeldOut& h = answer.held_out;
  if (h.known && !answer.adopts && !(other_channels && shown_elsewhere(d)))
    return fmt::format(
        "the effects reduce the held-out error by {} of the power, which is within its scatter",
        percent(h.file - h.explanation));
  if (!h.known && d.verdict != Verdict::effects)
    return fmt::format("the verdict has a probability of {}, and no power was held out",
                       probability_text(d.verdict_probability));
  return {};
}

// Mean |change of power| by one effect [W]; 0 without power.
double moved_w(const posterior::Fit& fit, const dynamics::ActiveEffect& effect) {
  if (!fit.data.power) return 0;
  std::vector<dynamics::ActiveEffect> with = fit.data.in_file;
  with.push_back(effect);
  return (posterior::predicted_power(fit.data, with) - fit.unchanged_w).cwiseAbs().mean();
}

// Whether the effect differs from the diagnosed one in its strengths only.
bool in_shape_of(const robot::AdoptedEffect& effect, const DiagnosedEffect& diagnosed) {
  const auto& info = dynamics::find_effect(effect.id)->info();
  for (std::size_t k = 1; k < info.parameters.size(); ++k)
    if (!info.parameters[k].strength && effect.parameters[k].second != diagnosed.parameters[k].value)
      return false;
  return true;
}

}  // namespace

void state_effects(const Explained& answer, double mean_power_w, Diagnosis& d) {
  d.verdict = answer.verdict;
  d.verdict_probability = answer.probability;
  d.detectable_share = answer.detectable;
  d.effects.clear();
  for (const posterior::ExplainedBy& found : answer.effects) {
    const double least = d.verdict == Verdict::effects ? posterior::named : posterior::least_listed;
    if (d.verdict == Verdict::none || found.group < least) continue;
    d.effects.push_back(found);
    d.effects.back().power_w = found.power_share * mean_power_w;
  }
  d.outside = answer.outside;
  if (d.verdict == Verdict::outside || d.outside.probability >= posterior::named) return;
  d.outside.channel.clear();
  d.outside.follows.clear();
}

void state_held_out(const HeldOut& h, Diagnosis& d) {
  if (!h.known) return;
  Baseline& b = d.baseline.emplace();
  b.held_out = h.regression;
  b.unchanged_model_held_out = h.file;
  b.explanation_held_out = h.explanation;
  const auto better = h.regression < h.file ? &HeldOut::Block::regression : &HeldOut::Block::file;
  double sum = 0, squares = 0, size = 0;
  for (const HeldOut::Block& block : h.blocks) {
    const double apart = block.explanation - block.*better;
    sum += apart, squares += apart * apart, size += block.size;
  }
  b.deviation = std::sqrt(std::max(0.0, squares - sum * sum / static_cast<double>(h.blocks.size()))) / size;
  if (d.effects.empty()) return;
  Shrinkage& s = d.shrinkage.emplace();
  s.before = h.file;
  s.after = h.explanation;
  s.fraction = 1 - s.after / s.before;
  s.interval = posterior::removed_interval(h.blocks);
  s.parts = std::min(posterior::folds, h.blocks.size());
  s.remaining_over_noise_floor = s.after / d.noise_floor;
}

void weigh_by_checks(Diagnosis& d) {
  const double sound = sound_readings(d.checks);
  d.verdict_probability *= sound;
  d.outside.probability *= sound;
  for (DiagnosedEffect& e : d.effects) e.probability *= sound, e.group *= sound;
  if (sound >= posterior::named) return;
  d.verdict = Verdict::inconclusive;
  d.corrections.clear();
  d.refusal = error_words(sound);
}

PowerSource power_source(const posterior::Data& data) {
  if (!data.power) return PowerSource::none;
  return data.rows.meter.empty() ? PowerSource::battery : PowerSource::motors;
}

void state_offer(const posterior::Fit& fit, const Explained& answer, bool other_channels, Diagnosis& d) {
  struct Offered {
    robot::AdoptedEffect effect;
    double moved_w = 0, deviation = missing;
  };
  std::vector<Offered> offered;
  for (const dynamics::ActiveEffect& effect : answer.model) {
    if (d.verdict == Verdict::none) break;
    Offered one{dynamics::adopt(effect), moved_w(fit, effect)};
    const auto own = std::ranges::find(d.effects, one.effect.id, &DiagnosedEffect::id);
    if (own != d.effects.end()) one.deviation = own->parameters.front().deviation;
    const bool named = own != d.effects.end() && own->group >= posterior::named;
    if (!named && !(one.moved_w > posterior::least_effect * fit.data.mean_power_w)) continue;
    const auto same = std::ranges::find(offered, one.effect.id, [](const Offered& o) { return o.effect.id; });
    if (same == offered.end())
      offered.push_back(std::move(one));
    else if (own != d.effects.end() ? in_shape_of(one.effect, *own) : same->moved_w < one.moved_w)
      *same = std::move(one);
  }
  std::vector<double> deviations;
  for (Offered& one : offered) {
    d.adoptable.push_back(std::move(one.effect));
    deviations.push_back(one.deviation);
  }
  if (d.verdict == Verdict::not_this_robot)
    d.corrections = corrections_of(fit.data.robot, d.adoptable, deviations);
  d.refusal = refusal_of(answer, other_channels, d);
}

}  // namespace joulecast::gap
