#include "tests/study/trial/score.h"

#include <algorithm>
#include <cmath>

namespace joulecast::trial {
namespace {

constexpr double close_share = 0.10;
constexpr double normal_95 = 1.959964;
constexpr double confident = 0.9;
// Required share of the oracle's shrinkage, by strength.
constexpr std::array<double, strength_classes> shrinkage_asked{0.8, 0.8, 0.9, 0.95};

std::size_t bin_of(double probability) {
  return static_cast<std::size_t>(std::clamp(10 * probability, 0.0, 9.0));
}

void count_strengths(const CaseOutcome& o, StrengthRow& row) {
  for (const robot::AdoptedEffect& truth : o.truth.effects) {
    const auto named = std::ranges::find(o.diagnosis.effects, truth.id, &gap::DiagnosedEffect::id);
    if (named == o.diagnosis.effects.end() || named->parameters.empty()) continue;
    const double strength = truth.parameters.front().second;
    const gap::DiagnosedParameter& p = named->parameters.front();
    const double error = std::fabs(p.value - strength);
    const bool within = error <= close_share * std::fabs(strength);
    const bool covered = std::isfinite(p.deviation) && error <= normal_95 * p.deviation;
    row.strength_within.count(within);
    row.interval_covers.count(covered);
    row.strength_close.count(within || covered);
  }
}

void count_shrinkage(const CaseOutcome& o, StrengthRow& row) {
  constexpr double least_oracle = 0.2;  // below it the removable gap is too small
  if (!o.oracle || *o.oracle < least_oracle) return;
  const double fraction = o.diagnosis.shrinkage ? std::max(0.0, o.diagnosis.shrinkage->fraction) : 0;
  row.shrinkage.diagnosed += fraction;
  row.shrinkage.oracle += *o.oracle;
  row.shrinkage.reached.count(fraction >=
                              shrinkage_asked[static_cast<std::size_t>(o.truth.strength)] * *o.oracle);
}

std::string truth_label(const SealedTruth& truth) {
  if (truth.effects.empty()) return "none";
  std::string label;
  for (const auto& effect : truth.effects) label += (label.empty() ? "" : " + ") + effect.id;
  return label;
}

std::string answer_label(const CaseOutcome& o) {
  if (exactly_right(o)) return "right";
  std::string label(gap::name_of(o.diagnosis.verdict));
  for (const auto& effect : o.diagnosis.effects) label += " " + effect.id;
  return label;
}

}  // namespace

std::vector<ComparisonRow> compare(std::span<const CaseOutcome> outcomes) {
  std::vector<ComparisonRow> rows;
  const std::size_t others = outcomes.empty() ? 0 : outcomes.front().others.size();
  for (std::size_t way = 0; way <= others; ++way) {
    std::vector<CaseOutcome> judged(outcomes.begin(), outcomes.end());
    ComparisonRow row;
    row.name = way == 0 ? "the method" : outcomes.front().others[way - 1].first;
    ShrinkageScore shrinkage;
    for (CaseOutcome& o : judged) {
      if (way > 0) o.diagnosis = o.others[way - 1].second;
      const bool right = exactly_right(o);
      const bool counts = o.truth.strength != Strength::slight;
      if (o.truth.kind == Kind::none) row.none_clear.count(right);
      if (o.truth.kind == Kind::outside && counts) row.outside_called.count(right);
      if (o.truth.kind == Kind::pair && counts) row.pair_exact.count(right);
      if (o.truth.kind == Kind::single && counts) {
        row.single_exact.count(right);
        row.single_first.count(first_right(o));
      }
      StrengthRow unused;
      if (counts && (o.truth.kind == Kind::single || o.truth.kind == Kind::pair)) {
        count_shrinkage(o, unused);
        shrinkage.diagnosed += unused.shrinkage.diagnosed;
        shrinkage.oracle += unused.shrinkage.oracle;
      }
    }
    row.shrinkage_over_oracle = shrinkage.ratio();
    rows.push_back(std::move(row));
  }
  return rows;
}

Score score_of(std::span<const CaseOutcome> outcomes) {
  Score score;
  std::vector<double> seconds;
  for (const CaseOutcome& o : outcomes) {
    const gap::Diagnosis& d = o.diagnosis;
    const bool right = exactly_right(o);
    StrengthRow& row = score.rows[o.truth.motor_channels ? 0 : 1][static_cast<std::size_t>(o.truth.strength)];
    score.not_this_robot.count(d.verdict == gap::Verdict::not_this_robot);
    switch (o.truth.kind) {
      case Kind::none:
        score.none_alarm.count(d.verdict != gap::Verdict::none && d.verdict != gap::Verdict::inconclusive);
        score.none_inconclusive.count(d.verdict == gap::Verdict::inconclusive);
        break;
      case Kind::outside:
        score.outside_called.count(right);
        score.outside_misled.count(
            std::ranges::any_of(d.effects, [](const auto& e) { return e.probability > confident; }));
        break;
      case Kind::single:
        row.single_first.count(first_right(o));
        row.single_exact.count(right);
        break;
      case Kind::pair:
        row.pair_first.count(first_right(o));
        row.pair_exact.count(right);
        break;
    }
    if (o.truth.kind == Kind::single || o.truth.kind == Kind::pair) {
      count_strengths(o, row);
      count_shrinkage(o, row);
    }
    for (const gap::DiagnosedEffect& effect : d.effects) {
      ReliabilityBin& bin = score.effect_reliability[bin_of(effect.probability)];
      bin.sum += effect.probability;
      bin.right.count(holds(o.truth, effect.id));
    }
    ReliabilityBin& bin = score.verdict_reliability[bin_of(d.verdict_probability)];
    bin.sum += d.verdict_probability;
    bin.right.count(right);
    ++score.confusion[truth_label(o.truth)][answer_label(o)];
    for (const std::string& variant : o.truth.variants) score.variants[variant].with.count(right);
    seconds.push_back(o.diagnosis_s);
  }
  Rate usual;
  for (const CaseOutcome& o : outcomes) {
    if (o.truth.variants.empty()) usual.count(exactly_right(o));
  }
  for (auto& [name, row] : score.variants) row.without = usual;
  if (!seconds.empty()) {
    std::ranges::sort(seconds);
    score.median_s = seconds[seconds.size() / 2];
    score.longest_s = seconds.back();
  }
  return score;
}

}  // namespace joulecast::trial
