#include "gap/runs/answer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/verdict/adopt.h"
#include "gap/verdict/held_out.h"
#include "gap/verdict/text.h"
#include "gap/verdict/words.h"
#include "statistics/regression.h"

namespace joulecast::gap {
namespace {

using posterior::ix;

// Offers the named effects, and calibrations that move as much as an effect worth a name.
void offer(const posterior::Fit& fit, const posterior::Explained& answer, Diagnosis& d) {
  std::vector<double> deviations;
  for (const dynamics::ActiveEffect& effect : answer.model) {
    const robot::AdoptedEffect adopted = dynamics::adopt(effect);
    const auto own = std::ranges::find(d.effects, adopted.id, &DiagnosedEffect::id);
    std::vector<dynamics::ActiveEffect> with = fit.data.in_file;
    with.push_back(effect);
    const double moved = (posterior::predicted_power(fit.data, with) - fit.unchanged_w).cwiseAbs().mean();
    if (own == d.effects.end() && !(moved > posterior::least_effect * fit.data.mean_power_w)) continue;
    d.adoptable.push_back(adopted);
    deviations.push_back(own == d.effects.end() ? missing : own->parameters.front().deviation);
  }
  if (d.verdict == Verdict::not_this_robot)
    d.corrections = corrections_of(fit.data.robot, d.adoptable, deviations);
}

std::string refusal(const posterior::Explained& answer, const Diagnosis& d) {
  if (d.adoptable.empty()) return "nothing was found that a robot file could take";
  if (d.verdict == Verdict::outside)
    return fmt::format("a cause outside the catalogue has a probability of {}",
                       probability_text(d.outside.probability));
  const posterior::HeldOut& h = answer.held_out;
  if (!answer.adopts)
    return fmt::format("the held-out error falls by {} of power, not by more than its scatter",
                       percent(h.file - h.explanation));
  return d.verdict == Verdict::effects ? refusal_by_alternatives(d) : std::string();
}

}  // namespace

void state_effects(const posterior::Explained& answer, double power_w, Diagnosis& d) {
  d.verdict = answer.verdict;
  d.verdict_probability = answer.probability;
  d.detectable_share = answer.detectable;
  if (answer.outside.probability >= posterior::named || d.verdict == Verdict::outside)
    d.outside = answer.outside;
  d.outside.probability = answer.outside.probability;
  d.effects = posterior::reported_effects(answer, power_w);
  for (const std::string& reason : answer.reasons) d.reasons.push_back(sentence(reason));
}

void state_offer(const posterior::Fit& fit, const posterior::Explained& answer, Diagnosis& d) {
  if (d.verdict != Verdict::none) offer(fit, answer, d);
  d.refusal = refusal(answer, d);
}

void state_held_out(const std::vector<posterior::HeldOut::Block>& errors, std::size_t parts, Diagnosis& d) {
  posterior::HeldOut::Block all;
  for (const posterior::HeldOut::Block& e : errors) {
    all.file += e.file;
    all.explanation += e.explanation;
    all.regression += e.regression;
    all.size += e.size;
  }
  Baseline& b = d.baseline.emplace();
  b.unchanged_model_held_out = all.file / all.size;
  b.explanation_held_out = all.explanation / all.size;
  b.held_out = all.regression / all.size;
  compare_blocks(errors, parts, d);
  if (d.shrinkage) d.shrinkage->remaining_over_noise_floor = d.shrinkage->after / d.noise_floor;
}

void state_terms(const posterior::Fit& fit, Baseline& b) {
  const posterior::PlainTerms terms = posterior::plain_terms(fit.data);
  std::vector<std::size_t> block;
  for (std::size_t r = 0; r < fit.data.rows.size(); ++r) block.push_back(fit.data.rows.window(r).block);
  const Eigen::VectorXd measured = fit.data.rows.measured_w();
  const auto data = statistics::robust_regression(terms.x, measured, block);
  const auto model = statistics::robust_regression(terms.x, fit.unchanged_w, block);
  for (std::size_t k = 0; k < terms.names.size(); ++k) {
    if (terms.x.col(ix(k)).isZero(0)) continue;
    b.terms.push_back({terms.names[k], terms.units[k], data.coefficients[ix(k)], data.sd[ix(k)],
                       model.coefficients[ix(k)]});
  }
}

}  // namespace joulecast::gap
