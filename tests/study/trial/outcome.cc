#include "tests/study/trial/outcome.h"

#include <algorithm>

namespace joulecast::trial {
namespace {

constexpr std::size_t most_alternatives = 2;  // a group of three

bool stands_for(const gap::DiagnosedEffect& reported, std::string_view id) {
  if (reported.id == id) return true;
  return reported.alternatives.size() <= most_alternatives &&
         std::ranges::find(reported.alternatives, id) != reported.alternatives.end();
}

}  // namespace

bool holds(const SealedTruth& truth, std::string_view id) {
  return std::ranges::any_of(truth.effects, [&](const auto& effect) { return effect.id == id; });
}

bool exactly_right(const CaseOutcome& o) {
  const gap::Diagnosis& d = o.diagnosis;
  switch (o.truth.kind) {
    case Kind::none:
      return d.verdict == gap::Verdict::none;
    case Kind::outside:
      return d.verdict == gap::Verdict::outside || d.verdict == gap::Verdict::inconclusive;
    case Kind::single:
    case Kind::pair:
      break;
  }
  if (d.verdict != gap::Verdict::effects || d.effects.size() != o.truth.effects.size()) return false;
  // One to one, in either order.
  std::vector<std::size_t> order(d.effects.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  do {
    bool all = true;
    for (std::size_t k = 0; k < order.size(); ++k) {
      all = all && stands_for(d.effects[order[k]], o.truth.effects[k].id);
    }
    if (all) return true;
  } while (std::ranges::next_permutation(order).found);
  return false;
}

bool first_right(const CaseOutcome& o) {
  const gap::Diagnosis& d = o.diagnosis;
  const bool named = d.verdict == gap::Verdict::effects || d.verdict == gap::Verdict::inconclusive ||
                     d.verdict == gap::Verdict::not_this_robot;
  return named && !d.effects.empty() && !o.truth.effects.empty() &&
         std::ranges::any_of(o.truth.effects,
                             [&](const auto& effect) { return stands_for(d.effects.front(), effect.id); });
}

}  // namespace joulecast::trial
