#include "tests/study/trial/motion/motion_text.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/json_number.h"

namespace joulecast::trial::motion {
namespace {

using nlohmann::json;

std::size_t count_of(const BaseLog& base) {
  std::size_t count = 0;
  for (const auto& instants : base.log.instants) count += instants.size();
  return count;
}

void add_line(std::string& out, std::string_view what, const MotionScore& score, Rate GapRow::*rate) {
  fmt::format_to(std::back_inserter(out), "{:<38}", what);
  for (const GapRow& row : score.rows)
    fmt::format_to(std::back_inserter(out), " {:<23}", rate_text(row.*rate));
  out += '\n';
}

void add_rate(std::string& out, std::string_view what, const Rate& rate) {
  if (rate.tries > 0) fmt::format_to(std::back_inserter(out), "{:<58} {}\n", what, rate_text(rate));
}

void add_confusion(std::string& out, const MotionScore& score) {
  out += "\nanswers by truth (+ before a name: it is there)\n";
  for (const auto& [truth, answers] : score.confusion) {
    std::vector<std::pair<std::size_t, std::string>> often;
    std::size_t cases = 0;
    for (const auto& [answer, count] : answers) {
      often.emplace_back(count, answer);
      cases += count;
    }
    std::ranges::stable_sort(often, std::greater{}, &std::pair<std::size_t, std::string>::first);
    fmt::format_to(std::back_inserter(out), "  {} ({}):", truth, cases);
    for (const auto& [count, answer] : often) {
      fmt::format_to(std::back_inserter(out), " [{}]", answer);
      if (count > 1) fmt::format_to(std::back_inserter(out), " x{}", count);
    }
    out += '\n';
  }
}

json row_json(const GapRow& r) {
  return {{"single_first", rate_json(r.first)},       {"single_first_or_group", rate_json(r.first_group)},
          {"single_reported", rate_json(r.reported)}, {"single_listed_first", rate_json(r.listed_first)},
          {"pair_both", rate_json(r.pair_both)},      {"pair_exact", rate_json(r.pair_exact)}};
}

json errors_json(const ReferenceScore& s) {
  return {{"within_1.05", rate_json(s.within)}, {"median", json_number(s.median)}};
}

}  // namespace

std::string base_logs_text(std::span<const BaseLog> logs, const std::vector<std::string>& skipped) {
  std::string out = fmt::format("{:<36} {:>8} {:>9} {:>8} {:>9} {:>9} {:>9}\n", "motion", "missions",
                                "readings", "every s", "base W", "residual", "mismatch");
  for (const BaseLog& base : logs) {
    double mean_w = 0;
    for (const Instant& at : base.log.all_instants()) {
      mean_w +=
          std::fabs(base_power_w(base.fit.form, base.fit.base, at)) / static_cast<double>(count_of(base));
    }
    fmt::format_to(std::back_inserter(out), "{:<36} {:>8} {:>9} {:>8.3g} {:>9.4g} {:>7.1f} % {:>7.2f} %{}\n",
                   base.log.name, base.log.missions.size(), count_of(base), base.log.battery.period_s, mean_w,
                   100 * base.residual, 100 * base.mismatch,
                   base.log.own_kinematics ? "" : "  (neutral kinematics: no robot file)");
  }
  for (const std::string& sentence : skipped) out += "left out: " + sentence + "\n";
  return out;
}

json base_logs_json(std::span<const BaseLog> logs) {
  json out = json::array();
  for (const BaseLog& base : logs) {
    json terms = json::object();
    for (std::size_t k = 0; k < term_count; ++k) {
      terms[std::string(name_of(static_cast<Term>(k)))] = json_number(base.fit.base[k]);
    }
    out.push_back({{"name", base.log.name},
                   {"missions", base.log.missions.size()},
                   {"readings", count_of(base)},
                   {"period_s", json_number(base.log.battery.period_s)},
                   {"current_step_a", json_number(base.log.battery.current_step_a)},
                   {"battery_resistance_ohm", json_number(base.log.battery.resistance_ohm)},
                   {"kinematics", base.log.own_kinematics ? "file" : "neutral"},
                   {"base", terms},
                   {"residual", json_number(base.residual)},
                   {"mismatch", json_number(base.mismatch)}});
  }
  return out;
}

std::string motion_score_text(const MotionScore& score) {
  std::string out = fmt::format("\n{:<38}", "added gap of each effect");
  for (const double gap : gap_classes)
    fmt::format_to(std::back_inserter(out), " {:<23}", fmt::format("{:.0f} %", 100 * gap));
  out += '\n';
  add_line(out, "single: first is it", score, &GapRow::first);
  add_line(out, "single: first, or its group", score, &GapRow::first_group);
  add_line(out, "single: among the names and groups", score, &GapRow::reported);
  add_line(out, "single: listed first, named or not", score, &GapRow::listed_first);
  add_line(out, "two: both named", score, &GapRow::pair_both);
  add_line(out, "two: both, no name more", score, &GapRow::pair_exact);
  out += '\n';
  add_rate(out, "single from 10 %, likeness below 0.9: first, or its group", score.told_apart);
  add_rate(out, "single, form of the catalogue: first, or its group", score.catalogue_form);
  add_rate(out, "single, another form: first, or its group", score.own_form);
  add_rate(out, "nothing planted: anything named", score.none_named);
  add_rate(out, "nothing planted: called outside", score.none_outside);
  add_rate(out, "nothing planted: verdict none", score.none_clear);
  add_rate(out, "load of its own: outside or inconclusive", score.outside_called);
  add_rate(out, "named at 0.9 and not there", score.misled);
  for (const auto& [kind, rate] : score.misled_by_kind) add_rate(out, "  " + kind, rate);
  add_rate(out, "verdict not_this_robot", score.not_this_robot);
  const auto errors = [&](std::string_view what, const ReferenceScore& s) {
    if (s.within.tries == 0) return;
    fmt::format_to(std::back_inserter(out), "{:<58} {}, median ratio {:.2f}\n", what, rate_text(s.within),
                   s.median);
  };
  out += "error at most 1.05 of the plain regression's\n";
  errors("  stated by the diagnosis, held out", score.stated_all);
  errors("    where the verdict is effects", score.stated_found);
  errors("  by the trial's own regression", score.own_all);
  errors("    where the verdict is effects", score.own_found);
  out += "\nstated probability of a name against how often that very effect is there\n";
  for (std::size_t k = 0; k < reliability_from.size(); ++k) {
    const double to = k + 1 < reliability_from.size() ? reliability_from[k + 1] : 1;
    fmt::format_to(std::back_inserter(out), "  {:.1f} to {:.1f}: stated {:.2f}, there {}\n",
                   reliability_from[k], to, score.reliability[k].mean(),
                   rate_text(score.reliability[k].right));
  }
  add_confusion(out, score);
  if (score.refused > 0) fmt::format_to(std::back_inserter(out), "\nrefused: {} cases\n", score.refused);
  fmt::format_to(std::back_inserter(out),
                 "\nprocessor time of a diagnosis: median {:.2f} s, longest {:.2f} s\n", score.median_s,
                 score.longest_s);
  return out;
}

json motion_score_json(const MotionScore& score) {
  json rows = json::array(), bins = json::array(), misled = json::object();
  for (std::size_t k = 0; k < gap_classes.size(); ++k) {
    rows.push_back(row_json(score.rows[k]));
    rows.back()["gap"] = gap_classes[k];
  }
  for (std::size_t k = 0; k < reliability_from.size(); ++k) {
    bins.push_back({{"from", reliability_from[k]},
                    {"stated", score.reliability[k].mean()},
                    {"there", rate_json(score.reliability[k].right)}});
  }
  for (const auto& [kind, rate] : score.misled_by_kind) misled[kind] = rate_json(rate);
  return {{"by_gap", rows},
          {"single_told_apart", rate_json(score.told_apart)},
          {"single_catalogue_form", rate_json(score.catalogue_form)},
          {"single_other_form", rate_json(score.own_form)},
          {"none_named", rate_json(score.none_named)},
          {"none_outside", rate_json(score.none_outside)},
          {"none_clear", rate_json(score.none_clear)},
          {"outside_called", rate_json(score.outside_called)},
          {"misled", rate_json(score.misled)},
          {"misled_by_kind", misled},
          {"not_this_robot", rate_json(score.not_this_robot)},
          {"stated_error_over_referee", errors_json(score.stated_all)},
          {"stated_error_over_referee_where_effects", errors_json(score.stated_found)},
          {"own_error_over_referee", errors_json(score.own_all)},
          {"own_error_over_referee_where_effects", errors_json(score.own_found)},
          {"reliability", bins},
          {"confusion", score.confusion},
          {"refused", score.refused},
          {"seconds_median", score.median_s},
          {"seconds_longest", score.longest_s}};
}

std::string motion_case_text(const MotionOutcome& o) {
  std::string truth, answer;
  for (const TrueEffect& e : o.truth.effects) {
    truth += fmt::format(" {}={:.3g}{}", e.id, e.strength, e.catalogue ? "" : " (" + e.form + ")");
  }
  bool all_there = true;
  for (const NamedEffect& e : o.answer.effects) {
    answer += fmt::format(" {}={:.3g} p{:.2f}", e.id, e.strength, e.probability);
    for (const std::string& other : e.alternatives) answer += "/" + other;
    all_there = all_there && is_there(o.truth, e);
  }
  if (!o.answer.outside_channel.empty()) {
    answer += " (" + o.answer.outside_channel + " by " + o.answer.outside_follows + ")";
  }
  if (!o.answer.refused.empty()) answer = " refused: " + o.answer.refused;
  return fmt::format(
      "{} {:4d} {} {} {:.0f} % |{} | {} {:.2f}{} | error {:.3f}, plain regression {:.3f}, file {:.3f} | "
      "{:.1f} s",
      all_there ? "ok " : "BAD", o.index, o.truth.log, name_of(o.truth.kind), 100 * o.truth.gap_class, truth,
      o.answer.verdict, o.answer.verdict_probability, answer, o.explanation_error, o.referee_error,
      o.unchanged_error, o.answer.processor_s);
}

json motion_case_json(const MotionOutcome& o) {
  json truth = json::array(), named = json::array();
  for (const TrueEffect& e : o.truth.effects) {
    truth.push_back({{"id", e.id},
                     {"form", e.form},
                     {"catalogue", e.catalogue},
                     {"strength", e.strength},
                     {"gap", e.gap},
                     {"nearest", e.nearest},
                     {"likeness", json_number(e.likeness)}});
  }
  for (const NamedEffect& e : o.answer.effects) {
    named.push_back({{"id", e.id},
                     {"probability", e.probability},
                     {"group", json_number(e.group)},
                     {"strength", json_number(e.strength)},
                     {"sd", json_number(e.deviation)},
                     {"alternatives", e.alternatives},
                     {"there", holds(o.truth, e.id)},
                     {"group_there", is_there(o.truth, e)}});
  }
  json out{{"trial", "motion"},
           {"case", o.index},
           {"digest", fmt::format("{:016x}", o.digest)},
           {"motion", o.truth.log},
           {"kind", name_of(o.truth.kind)},
           {"gap_class", o.truth.gap_class},
           {"truth", truth},
           {"verdict", o.answer.verdict},
           {"verdict_probability", o.answer.verdict_probability},
           {"effects", named},
           {"outside", {{"channel", o.answer.outside_channel}, {"follows", o.answer.outside_follows}}},
           {"gap", json_number(o.answer.gap)},
           {"noise_floor", json_number(o.answer.noise_floor)},
           {"referee_error", json_number(o.referee_error)},
           {"explanation_error", json_number(o.explanation_error)},
           {"unchanged_error", json_number(o.unchanged_error)},
           {"right", verdict_right(o)}};
  if (!o.answer.refused.empty()) out["refused"] = o.answer.refused;
  if (o.answer.referee_error) out["stated_referee_error"] = json_number(*o.answer.referee_error);
  if (o.answer.explanation_error) out["stated_explanation_error"] = json_number(*o.answer.explanation_error);
  if (o.answer.unchanged_error) out["stated_unchanged_error"] = json_number(*o.answer.unchanged_error);
  return out;
}

}  // namespace joulecast::trial::motion
