#include "tests/study/trial/score_text.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/json_number.h"

namespace joulecast::trial {
namespace {

using nlohmann::json;

constexpr std::array<Strength, strength_classes> strongest_first{Strength::strong, Strength::medium,
                                                                 Strength::weak, Strength::slight};

template <class Pick>
void add_line(std::string& out, const char* what, const std::array<StrengthRow, strength_classes>& rows,
              Pick pick) {
  fmt::format_to(std::back_inserter(out), "{:<34}", what);
  for (const Strength s : strongest_first) {
    fmt::format_to(std::back_inserter(out), " {:<24}", pick(rows[static_cast<std::size_t>(s)]));
  }
  out += '\n';
}

void add_rows(std::string& out, const char* title, const std::array<StrengthRow, strength_classes>& rows) {
  const bool any = std::ranges::any_of(
      rows, [](const StrengthRow& r) { return r.single_exact.tries + r.pair_exact.tries > 0; });
  if (!any) return;
  fmt::format_to(std::back_inserter(out), "\n{:<34} {:<24} {:<24} {:<24} {:<24}\n", title,
                 "strong (from 8 %)", "medium (4 to 8 %)", "weak (2 to 4 %)", "slight (below 2 %)");
  add_line(out, "single: named first", rows, [](const StrengthRow& r) { return rate_text(r.single_first); });
  add_line(out, "single: exactly it", rows, [](const StrengthRow& r) { return rate_text(r.single_exact); });
  add_line(out, "two: both, nothing false", rows,
           [](const StrengthRow& r) { return rate_text(r.pair_exact); });
  add_line(out, "two: first is one of them", rows,
           [](const StrengthRow& r) { return rate_text(r.pair_first); });
  add_line(out, "strength within 10 % or covered", rows,
           [](const StrengthRow& r) { return rate_text(r.strength_close); });
  add_line(out, "strength within 10 %", rows,
           [](const StrengthRow& r) { return rate_text(r.strength_within); });
  add_line(out, "95 % interval covers", rows,
           [](const StrengthRow& r) { return rate_text(r.interval_covers); });
  add_line(out, "shrinkage over the oracle's", rows, [](const StrengthRow& r) {
    const Rate& reached = r.shrinkage.reached;
    return reached.tries == 0
               ? std::string("-")
               : fmt::format("{:.3f}, {}/{} reach", r.shrinkage.ratio(), reached.hits, reached.tries);
  });
}

void add_reliability(std::string& out, const char* title, const std::array<ReliabilityBin, 10>& bins) {
  fmt::format_to(std::back_inserter(out), "\n{}\n", title);
  for (std::size_t k = 0; k < bins.size(); ++k) {
    if (bins[k].right.tries == 0) continue;
    fmt::format_to(std::back_inserter(out), "  {:.1f} to {:.1f}: stated {:.2f}, right {}\n",
                   0.1 * static_cast<double>(k), 0.1 * static_cast<double>(k + 1), bins[k].mean(),
                   rate_text(bins[k].right));
  }
}

json reliability_json(const std::array<ReliabilityBin, 10>& bins) {
  json out = json::array();
  for (std::size_t k = 0; k < bins.size(); ++k) {
    if (bins[k].right.tries == 0) continue;
    out.push_back({{"from", 0.1 * static_cast<double>(k)},
                   {"stated", bins[k].mean()},
                   {"right", rate_json(bins[k].right)}});
  }
  return out;
}

std::string short_list(const std::vector<std::string>& items, const char* separator) {
  std::string out;
  for (const auto& item : items) out += (out.empty() ? "" : separator) + item;
  return out;
}

}  // namespace

std::string score_text(const Score& score) {
  std::string out;
  add_rows(out, "all channels", score.rows[0]);
  add_rows(out, "battery and motion only", score.rows[1]);
  const auto line = [&](const char* what, const Rate& rate) {
    if (rate.tries > 0) fmt::format_to(std::back_inserter(out), "{:<34} {}\n", what, rate_text(rate));
  };
  out += '\n';
  line("verdict not_this_robot", score.not_this_robot);
  line("no gap: false alarm", score.none_alarm);
  line("no gap: inconclusive", score.none_inconclusive);
  line("outside: outside or inconclusive", score.outside_called);
  line("outside: named above 0.9", score.outside_misled);
  add_reliability(out, "probability of a named effect against how often it is there",
                  score.effect_reliability);
  add_reliability(out, "probability of a verdict against how often it is right", score.verdict_reliability);
  if (!score.variants.empty()) {
    fmt::format_to(std::back_inserter(out), "\nplant unlike the usual (usual: {} right)\n",
                   rate_text(score.variants.begin()->second.without));
    for (const auto& [name, row] : score.variants) {
      fmt::format_to(std::back_inserter(out), "  {:<20} {}\n", name, rate_text(row.with));
    }
  }
  out += "\nwrong answers by truth\n";
  for (const auto& [truth, answers] : score.confusion) {
    std::size_t cases = 0;
    for (const auto& [answer, count] : answers) cases += count;
    const auto right = answers.find("right");
    if (right != answers.end() && right->second == cases) continue;
    fmt::format_to(std::back_inserter(out), "  {} ({} of {} right):", truth,
                   right == answers.end() ? 0 : right->second, cases);
    for (const auto& [answer, count] : answers) {
      if (answer == "right") continue;
      fmt::format_to(std::back_inserter(out), " [{}]", answer);
      if (count > 1) fmt::format_to(std::back_inserter(out), " x{}", count);
    }
    out += '\n';
  }
  fmt::format_to(std::back_inserter(out),
                 "\nprocessor time of a diagnosis: median {:.2f} s, longest {:.2f} s\n", score.median_s,
                 score.longest_s);
  return out;
}

std::string comparison_text(const std::vector<ComparisonRow>& rows) {
  std::string out = fmt::format("{:<44} {:>9} {:>13} {:>13} {:>11} {:>9} {:>10}\n", "method", "none clear",
                                "single exact", "single first", "pair exact", "outside", "shrinkage");
  const auto part = [](const Rate& r) { return fmt::format("{}/{}", r.hits, r.tries); };
  for (const ComparisonRow& r : rows) {
    fmt::format_to(std::back_inserter(out), "{:<44} {:>10} {:>13} {:>13} {:>11} {:>9} {:>10.2f}\n", r.name,
                   part(r.none_clear), part(r.single_exact), part(r.single_first), part(r.pair_exact),
                   part(r.outside_called), r.shrinkage_over_oracle);
  }
  return out;
}

json comparison_json(const std::vector<ComparisonRow>& rows) {
  json out = json::array();
  for (const ComparisonRow& r : rows) {
    out.push_back({{"name", r.name},
                   {"none_clear", rate_json(r.none_clear)},
                   {"single_exact", rate_json(r.single_exact)},
                   {"single_first", rate_json(r.single_first)},
                   {"pair_exact", rate_json(r.pair_exact)},
                   {"outside_called", rate_json(r.outside_called)},
                   {"shrinkage_over_oracle", r.shrinkage_over_oracle}});
  }
  return out;
}

std::string case_text(const CaseOutcome& o) {
  std::string truth;
  for (const auto& effect : o.truth.effects) {
    truth += fmt::format(" {}={:.4g}", effect.id, effect.parameters.front().second);
  }
  std::string answer;
  for (const auto& effect : o.diagnosis.effects) {
    answer += fmt::format(" {}={:.4g}+-{:.2g} p{:.2f}", effect.id, effect.parameters.front().value,
                          effect.parameters.front().deviation, effect.probability);
    for (const auto& other : effect.alternatives) answer += "/" + other;
  }
  if (!o.diagnosis.outside.channel.empty()) {
    answer += " (" + o.diagnosis.outside.channel + " by " + o.diagnosis.outside.follows + ")";
  }
  const char* mark = exactly_right(o) ? "ok  " : first_right(o) ? "part" : "BAD ";
  const double shrinkage = o.diagnosis.shrinkage ? o.diagnosis.shrinkage->fraction : 0;
  return fmt::format(
      "{} {:4d} {} {} gap {:.1f} %{}{} |{} | {} {:.2f}{} | shrinks {:.2f} of {:.2f} | {:.1f} s", mark,
      o.index, o.truth.robot_kind, name_of(o.truth.strength), 100 * o.truth.added_gap,
      o.truth.motor_channels ? "" : " battery only",
      o.truth.variants.empty() ? "" : " {" + short_list(o.truth.variants, ", ") + "}", truth,
      gap::name_of(o.diagnosis.verdict), o.diagnosis.verdict_probability, answer, shrinkage,
      o.oracle.value_or(0), o.diagnosis_s);
}

json score_json(const Score& score) {
  json channels = json::object();
  for (std::size_t c : {0u, 1u}) {
    json table = json::object();
    for (const Strength s : strongest_first) {
      const StrengthRow& r = score.rows[c][static_cast<std::size_t>(s)];
      table[std::string(name_of(s))] = {
          {"single_named_first", rate_json(r.single_first)},
          {"single_exact", rate_json(r.single_exact)},
          {"pair_exact", rate_json(r.pair_exact)},
          {"pair_first", rate_json(r.pair_first)},
          {"strength_within_or_covered", rate_json(r.strength_close)},
          {"strength_within_10_percent", rate_json(r.strength_within)},
          {"interval_covers", rate_json(r.interval_covers)},
          {"shrinkage_over_oracle", r.shrinkage.oracle > 0 ? json(r.shrinkage.ratio()) : json()},
          {"shrinkage_reached", rate_json(r.shrinkage.reached)}};
    }
    channels[c == 0 ? "all_channels" : "battery_only"] = table;
  }
  json variants = json::object();
  for (const auto& [name, row] : score.variants) variants[name] = rate_json(row.with);
  return {
      {"by_strength", channels},
      {"not_this_robot", rate_json(score.not_this_robot)},
      {"none_false_alarm", rate_json(score.none_alarm)},
      {"none_inconclusive", rate_json(score.none_inconclusive)},
      {"outside_called", rate_json(score.outside_called)},
      {"outside_misled", rate_json(score.outside_misled)},
      {"effect_reliability", reliability_json(score.effect_reliability)},
      {"verdict_reliability", reliability_json(score.verdict_reliability)},
      {"variants", variants},
      {"usual_plant", score.variants.empty() ? json() : rate_json(score.variants.begin()->second.without)},
      {"confusion", score.confusion},
      {"seconds_median", score.median_s},
      {"seconds_longest", score.longest_s}};
}

json case_json(const CaseOutcome& o) {
  json truth = json::array();
  for (const auto& effect : o.truth.effects) {
    json values = json::object();
    for (const auto& [name, value] : effect.parameters) values[name] = value;
    truth.push_back({{"id", effect.id}, {"values", values}});
  }
  json named = json::array();
  for (const auto& effect : o.diagnosis.effects) {
    named.push_back({{"id", effect.id},
                     {"probability", effect.probability},
                     {"group", effect.group},
                     {"there", holds(o.truth, effect.id)},
                     {"strength", effect.parameters.front().value},
                     {"sd", json_number(effect.parameters.front().deviation)},
                     {"share", json_number(effect.share)},
                     {"alternatives", effect.alternatives}});
  }
  return {{"trial", "virtual"},
          {"case", o.index},
          {"digest", fmt::format("{:016x}", o.digest)},
          {"kind", name_of(o.truth.kind)},
          {"strength", name_of(o.truth.strength)},
          {"robot", o.truth.robot_kind},
          {"variants", o.truth.variants},
          {"motor_channels", o.truth.motor_channels},
          {"added_gap", o.truth.added_gap},
          {"truth", truth},
          {"verdict", gap::name_of(o.diagnosis.verdict)},
          {"verdict_probability", o.diagnosis.verdict_probability},
          {"effects", named},
          {"outside",
           {{"probability", o.diagnosis.outside.probability},
            {"channel", o.diagnosis.outside.channel},
            {"follows", o.diagnosis.outside.follows}}},
          {"gap", json_number(o.diagnosis.power_absolute_relative)},
          {"noise_floor", json_number(o.diagnosis.noise_floor)},
          {"remaining", o.diagnosis.shrinkage ? json(o.diagnosis.shrinkage->after) : json()},
          {"shrinkage", o.diagnosis.shrinkage ? json(o.diagnosis.shrinkage->fraction) : json()},
          {"oracle_shrinkage", o.oracle ? json(*o.oracle) : json()},
          {"right", exactly_right(o)},
          {"first_right", first_right(o)}};
}

}  // namespace joulecast::trial
