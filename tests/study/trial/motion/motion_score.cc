#include "tests/study/trial/motion/motion_score.h"

#include <algorithm>
#include <vector>

namespace joulecast::trial::motion {
namespace {

constexpr std::size_t most_alternatives = 2;  // a group of three
constexpr double referee_margin = 1.05;

bool misled(const MotionOutcome& o) {
  return std::ranges::any_of(o.answer.effects, [&](const NamedEffect& e) {
    return e.probability >= confident && !is_there(o.truth, e);
  });
}

std::vector<NamedEffect> names_of(const Answer& answer) {
  std::vector<NamedEffect> names;
  for (const NamedEffect& e : answer.effects) {
    if (answer.verdict == "effects" || e.probability >= named_from) names.push_back(e);
  }
  return names;
}

// Both effects of a pair, each by a name of its own.
bool both_named(const MotionTruth& truth, const std::vector<NamedEffect>& names) {
  for (std::size_t a = 0; a < names.size(); ++a) {
    for (std::size_t b = 0; b < names.size(); ++b) {
      if (a != b && stands_for(names[a], truth.effects[0].id) && stands_for(names[b], truth.effects[1].id))
        return true;
    }
  }
  return false;
}

std::string truth_label(const MotionTruth& truth) {
  std::string label;
  for (const TrueEffect& e : truth.effects) label += (label.empty() ? "" : " + ") + e.id;
  return label.empty() ? "none" : label;
}

std::string answer_label(const MotionOutcome& o) {
  if (!o.answer.refused.empty()) return "refused";
  std::string label = o.answer.verdict;
  for (const NamedEffect& e : names_of(o.answer)) label += (is_there(o.truth, e) ? " +" : " ") + e.id;
  return label;
}

void count_errors(std::optional<double> explained, std::optional<double> referee, ReferenceScore& score,
                  std::vector<double>& ratios) {
  if (!explained || !referee || !(*referee > 0)) return;
  ratios.push_back(*explained / *referee);
  score.within.count(ratios.back() <= referee_margin);
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void count_single(const MotionOutcome& o, GapRow& row, MotionScore& score) {
  const std::string& id = o.truth.effects[0].id;
  const std::vector<NamedEffect> names = names_of(o.answer);
  const bool group = !names.empty() && stands_for(names[0], id);
  row.first.count(!names.empty() && names[0].id == id);
  row.first_group.count(group);
  row.listed_first.count(!o.answer.effects.empty() && stands_for(o.answer.effects[0], id));
  row.reported.count(std::ranges::any_of(names, [&](const NamedEffect& e) { return stands_for(e, id); }));
  if (o.truth.gap_class >= 0.1 && o.truth.effects[0].likeness < 0.9) score.told_apart.count(group);
  (o.truth.effects[0].catalogue ? score.catalogue_form : score.own_form).count(group);
}

void count_kind(const MotionOutcome& o, MotionScore& score) {
  const std::vector<NamedEffect> names = names_of(o.answer);
  const auto row = std::ranges::find(gap_classes, o.truth.gap_class);
  GapRow unused;
  GapRow& by_gap =
      row == gap_classes.end() ? unused : score.rows[static_cast<std::size_t>(row - gap_classes.begin())];
  switch (o.truth.kind) {
    case Kind::none:
      score.none_named.count(!names.empty());
      score.none_outside.count(o.answer.verdict == "outside");
      score.none_clear.count(o.answer.verdict == "none");
      break;
    case Kind::single:
      count_single(o, by_gap, score);
      break;
    case Kind::pair: {
      const bool both = both_named(o.truth, names);
      by_gap.pair_both.count(both);
      by_gap.pair_exact.count(both && names.size() == 2);
      break;
    }
    case Kind::outside:
      score.outside_called.count(o.answer.verdict == "outside" || o.answer.verdict == "inconclusive");
      break;
  }
}

}  // namespace

bool stands_for(const NamedEffect& reported, std::string_view id) {
  if (reported.id == id) return true;
  return reported.alternatives.size() <= most_alternatives &&
         std::ranges::find(reported.alternatives, id) != reported.alternatives.end();
}

bool holds(const MotionTruth& truth, std::string_view id) {
  return std::ranges::any_of(truth.effects, [&](const TrueEffect& e) { return e.id == id; });
}

bool is_there(const MotionTruth& truth, const NamedEffect& reported) {
  return std::ranges::any_of(truth.effects, [&](const TrueEffect& e) { return stands_for(reported, e.id); });
}

bool verdict_right(const MotionOutcome& o) {
  const Answer& a = o.answer;
  switch (o.truth.kind) {
    case Kind::none:
      return a.verdict == "none";
    case Kind::outside:
      return a.verdict == "outside" || a.verdict == "inconclusive";
    case Kind::single:
      return a.verdict == "effects" && a.effects.size() == 1 && is_there(o.truth, a.effects[0]);
    case Kind::pair:
      return a.verdict == "effects" && a.effects.size() == 2 && both_named(o.truth, a.effects);
  }
  return false;
}

MotionScore motion_score_of(std::span<const MotionOutcome> outcomes) {
  MotionScore score;
  std::vector<double> stated, stated_found, own, own_found, seconds;
  for (const MotionOutcome& o : outcomes) {
    count_kind(o, score);
    score.misled.count(misled(o));
    score.misled_by_kind[std::string(name_of(o.truth.kind))].count(misled(o));
    for (const NamedEffect& e : o.answer.effects) {
      const auto above = std::ranges::upper_bound(reliability_from, e.probability);
      ReliabilityBin& bin = score.reliability[static_cast<std::size_t>(above - reliability_from.begin()) - 1];
      bin.sum += e.probability;
      bin.right.count(holds(o.truth, e.id));
    }
    const Answer& a = o.answer;
    const bool found = a.verdict == "effects";
    count_errors(a.explanation_error, a.referee_error, score.stated_all, stated);
    count_errors(o.explanation_error, o.referee_error, score.own_all, own);
    if (found) count_errors(a.explanation_error, a.referee_error, score.stated_found, stated_found);
    if (found) count_errors(o.explanation_error, o.referee_error, score.own_found, own_found);
    score.not_this_robot.count(a.verdict == "not_this_robot");
    ++score.confusion[truth_label(o.truth)][answer_label(o)];
    score.refused += o.answer.refused.empty() ? 0 : 1;
    seconds.push_back(o.answer.processor_s);
  }
  score.stated_all.median = median_of(std::move(stated));
  score.stated_found.median = median_of(std::move(stated_found));
  score.own_all.median = median_of(std::move(own));
  score.own_found.median = median_of(std::move(own_found));
  score.median_s = median_of(seconds);
  score.longest_s = seconds.empty() ? 0 : std::ranges::max(seconds);
  return score;
}

}  // namespace joulecast::trial::motion
