#include "gap/diagnose/account.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/verdict/words.h"
#include "statistics/bootstrap.h"

namespace joulecast::gap {

Baseline baseline_of(const HeldOut& held_out, bool with_functions) {
  Baseline baseline;
  baseline.held_out = held_out.referee();
  baseline.unchanged_model_held_out = held_out.unchanged();
  baseline.explanation_held_out = with_functions ? held_out.explained_with_functions() : held_out.explained();
  const auto better =
      baseline.held_out < baseline.unchanged_model_held_out ? &BlockErrors::referee : &BlockErrors::unchanged;
  const double blocks = static_cast<double>(held_out.blocks.size());
  double sum = 0, squares = 0, size = 0;
  for (const BlockErrors& b : held_out.blocks) {
    const double apart = b.explained - (with_functions ? b.spared : 0) - b.*better;
    sum += apart, squares += apart * apart, size += b.size;
  }
  baseline.deviation =
      std::sqrt(blocks * std::max(0.0, squares / blocks - sum * sum / blocks / blocks)) / size;
  return baseline;
}

void add_term(Baseline& baseline, const RefereeTerm& term, double data, double deviation, double model) {
  baseline.terms.push_back({term.name, term.unit, data, deviation, model});
  constexpr double clear = 3, notable = 0.2;
  const double apart = std::fabs(data - model);
  if (!(deviation > 0) || apart < clear * deviation || apart < notable * std::fabs(data)) return;
  baseline.says.push_back(
      sentence(fmt::format("the data have {} {}; the model has {}", brief(data), term.words, brief(model))));
}

Shrinkage shrinkage_of(const HeldOut& held_out, const std::vector<Hypothesis>& hypotheses,
                       const HypothesisSet& named, double noise_floor) {
  Shrinkage s;
  s.before = held_out.unchanged();
  s.after = held_out.explained();
  s.fraction = 1 - s.after / s.before;
  s.interval = statistics::bootstrap_interval(held_out.blocks.size(), [&](std::span<const int> draw) {
    double before = 0, after = 0;
    for (std::size_t b = 0; b < draw.size(); ++b) {
      before += draw[b] * held_out.blocks[b].unchanged;
      after += draw[b] * held_out.blocks[b].explained;
    }
    return 1 - after / before;
  });
  s.remaining_over_noise_floor = noise_floor > 0 ? s.after / noise_floor : missing;
  s.parts = held_out.parts;
  std::vector<std::string> ids;
  for (const std::size_t h : named) ids.push_back(hypotheses[h].id());
  std::ranges::sort(ids);
  for (std::vector<std::string> part : held_out.named) {
    std::ranges::sort(part);
    s.agreeing += part == ids ? 1 : 0;
  }
  return s;
}

}  // namespace joulecast::gap
