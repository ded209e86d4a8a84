#include "gap/runs/answer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/traits.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/text.h"
#include "gap/verdict/words.h"
#include "statistics/bootstrap.h"
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
    return fmt::format("the held-out error falls by {} of power, less than {}",
                       percent(h.file - h.explanation), percent(posterior::clear_gain));
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
  for (const posterior::ExplainedBy& found : answer.effects) {
    if (d.verdict == Verdict::none) break;
    // With named effects, only named effects are reported.
    if (d.verdict == Verdict::effects && found.group < posterior::named) continue;
    DiagnosedEffect& e = d.effects.emplace_back();
    e.id = found.id;
    e.probability = found.probability;
    e.group = found.group;
    e.instead = found.instead;
    e.instead_differs = found.instead_differs;
    e.varies = found.scatter;
    e.parameters = found.parameters;
    e.share = found.held_out_share;
    e.power_w = found.power_share * power_w;
    e.alternatives = found.alternatives;
    if (dynamics::find_effect(e.id) != nullptr) e.calibrates = traits_of(e.id).calibrates;
  }
  for (const std::string& reason : answer.reasons) d.reasons.push_back(sentence(reason));
}

void state_offer(const posterior::Fit& fit, const posterior::Explained& answer, Diagnosis& d) {
  if (d.verdict != Verdict::none) offer(fit, answer, d);
  d.refusal = refusal(answer, d);
}

void state_held_out(const posterior::Fit& fit, const std::vector<LeftOutErrors>& errors, std::size_t parts,
                    Diagnosis& d) {
  const double n = static_cast<double>(errors.size());
  Baseline& b = d.baseline.emplace();
  for (const LeftOutErrors& e : errors) {
    b.unchanged_model_held_out += e.unchanged / n;
    b.explanation_held_out += e.explained / n;
    b.held_out += e.regression / n;
  }
  const auto better =
      b.held_out < b.unchanged_model_held_out ? &LeftOutErrors::regression : &LeftOutErrors::unchanged;
  double sum = 0, squares = 0;
  for (const LeftOutErrors& e : errors) {
    const double apart = e.explained - e.*better;
    sum += apart, squares += apart * apart;
  }
  b.deviation = std::sqrt(std::max(0.0, squares - sum * sum / n)) / n;
  const posterior::PlainTerms terms = posterior::plain_terms(fit.data);
  std::vector<std::size_t> block;
  for (std::size_t r = 0; r < fit.data.rows.size(); ++r) block.push_back(fit.data.rows.window(r).block);
  const Eigen::VectorXd measured =
      Eigen::Map<const Eigen::VectorXd>(fit.data.rows.power_w.data(), terms.x.rows());
  const auto data = statistics::robust_regression(terms.x, measured, block);
  const auto model = statistics::robust_regression(terms.x, fit.unchanged_w, block);
  for (std::size_t k = 0; k < terms.names.size(); ++k) {
    if (terms.x.col(ix(k)).isZero(0)) continue;
    b.terms.push_back({terms.names[k], terms.units[k], data.coefficients[ix(k)], data.sd[ix(k)],
                       model.coefficients[ix(k)]});
  }
  if (d.effects.empty()) return;
  Shrinkage& s = d.shrinkage.emplace();
  s.before = b.unchanged_model_held_out;
  s.after = b.explanation_held_out;
  s.fraction = 1 - s.after / s.before;
  s.interval = statistics::bootstrap_interval(errors.size(), [&](std::span<const int> draw) {
    double before = 0, after = 0;
    for (std::size_t k = 0; k < draw.size(); ++k)
      before += draw[k] * errors[k].unchanged, after += draw[k] * errors[k].explained;
    return 1 - after / before;
  });
  s.remaining_over_noise_floor = s.after / d.noise_floor;
  s.parts = parts;
}

}  // namespace joulecast::gap
