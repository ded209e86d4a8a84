#include "tests/study/trial/kept/kept_score.h"

#include <fmt/core.h>
#include <re2/re2.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/study/trial/motion/motion_score.h"

namespace joulecast::trial::kept {
namespace {

using motion::NamedEffect;
using motion::stands_for;
using nlohmann::json;

constexpr double normal_95 = 1.959964;
constexpr double close_share = 0.10;
constexpr double regression_margin = 1.05;

// The label and the rate of each row.
const std::vector<std::pair<const char*, Rate KeptScore::*>> rate_rows{
    {"nothing planted: a cause is named", &KeptScore::none_named},
    {"nothing planted: verdict outside", &KeptScore::none_outside},
    {"one effect: first", &KeptScore::first},
    {"one effect: first, or in its group", &KeptScore::in_group},
    {"one effect: listed first at any probability", &KeptScore::listed_first},
    {"one effect: exact", &KeptScore::exact},
    {"two effects: first is one of them", &KeptScore::pair_first},
    {"two effects: both named", &KeptScore::pair_named},
    {"two effects: exact", &KeptScore::pair_exact},
    {"not in the catalogue: outside or inconclusive", &KeptScore::outside_or_inconclusive},
    {"not in the catalogue: verdict outside", &KeptScore::outside},
    {"wrong at 0.9 or more", &KeptScore::sure_and_wrong},
    {"strength within 10 % or its 95 % interval", &KeptScore::strength_close},
    {"real recording: right", &KeptScore::real_right},
    {"real recording: inconclusive", &KeptScore::real_inconclusive},
    {"real recording: wrong", &KeptScore::real_wrong},
    {"halves agree", &KeptScore::halves_agree},
    {"held-out error <= 1.05 of the regression", &KeptScore::held_out},
    {"no answer", &KeptScore::refused},
};

std::vector<NamedEffect> names_of(const EngineAnswer& answer) {
  std::vector<NamedEffect> names;
  std::ranges::copy_if(answer.effects, std::back_inserter(names),
                       [](const NamedEffect& e) { return e.probability >= named_from; });
  return names;
}

bool is_planted(const KeptTruth& truth, const NamedEffect& named) {
  return std::ranges::any_of(truth.effects, [&](const PlantedEffect& e) { return stands_for(named, e.id); });
}

bool both_named(const KeptTruth& truth, const std::vector<NamedEffect>& names) {
  for (const NamedEffect& a : names) {
    for (const NamedEffect& b : names) {
      if (&a != &b && stands_for(a, truth.effects[0].id) && stands_for(b, truth.effects[1].id)) return true;
    }
  }
  return false;
}

bool within(const Expected& expected, const NamedEffect& named) {
  return (!expected.from || named.strength >= *expected.from) &&
         (!expected.to || named.strength <= *expected.to);
}

const Expected* find_expected(const std::vector<Expected>& list, std::string_view id) {
  const auto at = std::ranges::find(list, id, &Expected::id);
  return at == list.end() ? nullptr : &*at;
}

// A true effect, or one with a true effect in its group.
bool is_right(const KeptTruth& truth, const NamedEffect& named) {
  if (const Expected* right = find_expected(truth.right, named.id)) return within(*right, named);
  return std::ranges::any_of(truth.right, [&](const Expected& e) { return stands_for(named, e.id); });
}

bool is_refuted(const KeptTruth& truth, const NamedEffect& named) {
  if (is_right(truth, named)) return false;
  const Expected* neutral = find_expected(truth.neutral, named.id);
  return neutral == nullptr || !within(*neutral, named);
}

bool matches(const std::string& pattern, const std::string& text) {
  return !pattern.empty() && RE2::PartialMatch(text, "(?i)" + pattern);
}

void count_planted(const KeptTruth& truth, const EngineAnswer& answer, KeptScore& score) {
  const std::vector<NamedEffect> names = names_of(answer);
  const bool effects = answer.verdict == "effects";
  switch (*truth.kind) {
    case Kind::none:
      score.none_named.count(!names.empty());
      score.none_outside.count(answer.verdict == "outside");
      break;
    case Kind::single: {
      const std::string& id = truth.effects.front().id;
      score.first.count(!names.empty() && names.front().id == id);
      score.in_group.count(!names.empty() && stands_for(names.front(), id));
      score.listed_first.count(!answer.effects.empty() && stands_for(answer.effects.front(), id));
      score.exact.count(effects && names.size() == 1 && stands_for(names.front(), id));
      break;
    }
    case Kind::pair: {
      const bool both = both_named(truth, names);
      score.pair_first.count(!names.empty() && is_planted(truth, names.front()));
      score.pair_named.count(both);
      score.pair_exact.count(both && effects && names.size() == 2);
      break;
    }
    case Kind::outside:
      score.outside_or_inconclusive.count(answer.verdict == "outside" || answer.verdict == "inconclusive");
      score.outside.count(answer.verdict == "outside");
      break;
  }
  score.sure_and_wrong.count(std::ranges::any_of(
      names, [&](const NamedEffect& e) { return e.probability >= sure_from && !is_planted(truth, e); }));
  for (const NamedEffect& e : names) {
    const auto planted = std::ranges::find(truth.effects, e.id, &PlantedEffect::id);
    const auto above = std::ranges::upper_bound(reliability_from, e.probability);
    const auto bin = static_cast<std::size_t>(above - reliability_from.begin()) - 1;
    for (auto& [bins, right] : {std::pair{&score.effect_true, planted != truth.effects.end()},
                                std::pair{&score.group_true, is_planted(truth, e)}}) {
      (*bins)[bin].sum += e.probability;
      (*bins)[bin].right.count(right);
    }
    if (planted == truth.effects.end() || !planted->strength) continue;
    const double error = std::fabs(e.strength - *planted->strength);
    score.strength_close.count(error <= close_share * std::fabs(*planted->strength) ||
                               error <= normal_95 * e.deviation);
  }
}

// Two halves agree in their verdict and in every name or its group.
bool agree(const EngineAnswer& a, const EngineAnswer& b) {
  const auto covers = [](const std::vector<NamedEffect>& some, const std::vector<NamedEffect>& others) {
    return std::ranges::all_of(some, [&](const NamedEffect& e) {
      return std::ranges::any_of(
          others, [&](const NamedEffect& o) { return stands_for(o, e.id) || stands_for(e, o.id); });
    });
  };
  const auto x = names_of(a), y = names_of(b);
  return a.verdict == b.verdict && covers(x, y) && covers(y, x);
}

void count_case(const KeptCase& kept, const Answers& answers, KeptScore& score,
                std::vector<double>& seconds) {
  const EngineAnswer& answer = answers.at(kept.id);
  const KeptTruth& truth = *kept.truth;
  score.refused.count(!answer.refused.empty());
  seconds.push_back(answer.processor_s);
  if (truth.kind) count_planted(truth, answer, score);
  if (!truth.right.empty()) {
    const std::string result = real_class(truth, answer);
    score.real_right.count(result == "right");
    score.real_inconclusive.count(result == "inconclusive");
    score.real_wrong.count(result == "wrong");
    score.sure_and_wrong.count(result == "misled");
  }
  const auto other = answers.find(truth.other);
  if (other != answers.end() && kept.id < truth.other) score.halves_agree.count(agree(answer, other->second));
  if (answer.explanation_error && answer.referee_error && *answer.referee_error > 0)
    score.held_out.count(*answer.explanation_error <= regression_margin * *answer.referee_error);
}

std::string title_of(const KeptCase& kept) {
  return kept.group + ", " +
         (kept.channels == "recorded" ? "channels as recorded" : "channels: " + kept.channels);
}

void finish_times(KeptScore& score, std::vector<double>& seconds) {
  if (seconds.empty()) return;
  std::ranges::sort(seconds);
  score.median_s = seconds[seconds.size() / 2];
  score.longest_s = seconds.back();
}

std::string bin_label(std::size_t k) {
  return k + 1 < reliability_from.size()
             ? fmt::format("stated {:.2f} to {:.2f}", reliability_from[k], reliability_from[k + 1])
             : fmt::format("stated {:.2f} and more", reliability_from[k]);
}

std::string cell(const ReliabilityBin& bin) {
  return bin.right.tries == 0 ? "-" : fmt::format("{} at {:.2f}", rate_text(bin.right), bin.mean());
}

}  // namespace

std::string real_class(const KeptTruth& truth, const EngineAnswer& answer) {
  const bool outside = answer.verdict == "outside";
  const std::string follows = answer.outside_channel + " " + answer.outside_follows;
  const bool outside_right = outside && matches(truth.outside, follows);
  const bool outside_refuted = outside && !outside_right && matches(truth.refuted, follows);
  for (const NamedEffect& e : answer.effects) {
    if (e.probability >= sure_from && is_refuted(truth, e)) return "misled";
  }
  if (outside_refuted) return answer.verdict_probability >= sure_from ? "misled" : "wrong";
  const bool corrected = std::ranges::any_of(answer.corrections, [&](const EngineAnswer::Correction& c) {
    return c.probability >= named_from && matches(truth.corrections, c.text);
  });
  const bool named = answer.verdict == "effects" || answer.verdict == "not_this_robot";
  const bool right =
      std::ranges::any_of(names_of(answer), [&](const NamedEffect& e) { return is_right(truth, e); });
  if (outside_right || corrected || (named && right)) return "right";
  return answer.verdict == "inconclusive" || answer.verdict == "not_this_robot" || !answer.refused.empty()
             ? "inconclusive"
             : "wrong";
}

std::vector<std::pair<std::string, KeptScore>> score_kept(const std::vector<KeptCase>& cases,
                                                          const Answers& answers) {
  std::vector<std::pair<std::string, KeptScore>> scores;
  std::vector<std::vector<double>> seconds;
  KeptScore all;
  std::vector<double> all_seconds;
  for (const KeptCase& kept : cases) {
    if (!kept.truth || !answers.contains(kept.id)) continue;
    const std::string title = title_of(kept);
    auto at = std::ranges::find(scores, title, &std::pair<std::string, KeptScore>::first);
    if (at == scores.end()) {
      scores.emplace_back(title, KeptScore{});
      seconds.emplace_back();
      at = std::prev(scores.end());
    }
    count_case(kept, answers, at->second, seconds[static_cast<std::size_t>(at - scores.begin())]);
    count_case(kept, answers, all, all_seconds);
  }
  for (std::size_t k = 0; k < scores.size(); ++k) finish_times(scores[k].second, seconds[k]);
  finish_times(all, all_seconds);
  if (scores.size() != 1) scores.emplace_back("all cases", all);
  return scores;
}

std::string score_table(const std::vector<KeptCase>& cases,
                        const std::vector<std::pair<std::string, Answers>>& columns) {
  // The basis for comparing several engines: cases that all of them have answered.
  std::vector<KeptCase> common;
  std::ranges::copy_if(cases, std::back_inserter(common), [&](const KeptCase& kept) {
    return std::ranges::all_of(columns, [&](const auto& column) { return column.second.contains(kept.id); });
  });
  std::vector<std::vector<std::pair<std::string, KeptScore>>> scores;
  for (const auto& [name, answers] : columns) scores.push_back(score_kept(common, answers));
  std::string out;
  const auto row = [&](const std::string& label, std::vector<std::string> cells) {
    if (std::ranges::all_of(cells, [](const std::string& c) { return c == "-"; })) return;
    fmt::format_to(std::back_inserter(out), "  {:<46}", label);
    for (std::size_t c = 0; c + 1 < cells.size(); ++c)
      fmt::format_to(std::back_inserter(out), " {:<32}", cells[c]);
    out += " " + cells.back() + "\n";
  };
  for (std::size_t group = 0; group < scores.front().size(); ++group) {
    const std::string& title = scores.front()[group].first;
    const auto of = static_cast<std::size_t>(std::ranges::count_if(
        cases, [&](const KeptCase& kept) { return title == title_of(kept) || title == "all cases"; }));
    fmt::format_to(std::back_inserter(out), "{}{} ({} of {} cases)\n", group > 0 ? "\n" : "", title,
                   scores.front()[group].second.refused.tries, of);
    const auto rows = [&](const std::string& label, const auto& cell_of) {
      std::vector<std::string> cells;
      for (const auto& column : scores) cells.push_back(cell_of(column[group].second));
      row(label, cells);
    };
    if (columns.size() > 1) {
      std::vector<std::string> heads;
      for (const auto& column : columns) heads.push_back(column.first);
      row("", heads);
    }
    for (const auto& [label, rate] : rate_rows)
      rows(label, [&](const KeptScore& s) { return rate_text(s.*rate); });
    for (std::size_t k = 0; k < reliability_from.size(); ++k) {
      rows(bin_label(k) + ": true", [&](const KeptScore& s) { return cell(s.effect_true[k]); });
      rows(bin_label(k) + ": true, or its group", [&](const KeptScore& s) { return cell(s.group_true[k]); });
    }
    rows("processor time, median and longest",
         [](const KeptScore& s) { return fmt::format("{:.2g} s, {:.2g} s", s.median_s, s.longest_s); });
  }
  return out;
}

json kept_score_json(const KeptScore& score) {
  json out = json::object();
  for (const auto& [label, rate] : rate_rows) {
    if ((score.*rate).tries > 0) out[label] = rate_json(score.*rate);
  }
  for (std::size_t k = 0; k < reliability_from.size(); ++k) {
    for (const auto& [suffix, bin] : {std::pair{": true", &score.effect_true[k]},
                                      std::pair{": true, or its group", &score.group_true[k]}}) {
      if (bin->right.tries > 0)
        out[bin_label(k) + suffix] = {{"stated", bin->mean()}, {"true", rate_json(bin->right)}};
    }
  }
  out["processor_s"] = {{"median", score.median_s}, {"longest", score.longest_s}};
  return out;
}

}  // namespace joulecast::trial::kept
