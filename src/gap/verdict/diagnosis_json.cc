#include "gap/verdict/diagnosis_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "gap/traits.h"
#include "gap/verdict/offer.h"
#include "gap/verdict/text.h"

namespace joulecast::gap {
namespace {

using nlohmann::ordered_json;

ordered_json text_or_null(std::string_view text) {
  return text.empty() ? ordered_json(nullptr) : ordered_json(text);
}

ordered_json value_to_json(double value, double deviation, const std::string& unit) {
  return {{"value", json_number(value)}, {"sd", json_number(deviation)}, {"unit", unit}};
}

ordered_json channels_to_json(const Diagnosis& d) {
  ordered_json channels = ordered_json::object();
  for (const ChannelGap& gap : d.channels) {
    channels[gap.channel] = {{"absolute_relative", json_number(gap.absolute_relative)},
                             {"noise_floor", json_number(gap.noise_floor)}};
  }
  return channels;
}

ordered_json checks_to_json(const Diagnosis& d) {
  ordered_json checks = ordered_json::array();
  for (const Check& check : d.checks) {
    checks.push_back({{"id", check.id},
                      {"channel", text_or_null(check.channel)},
                      {"value", json_number(check.value)},
                      {"interval", json_interval(check.interval)},
                      {"says", check.says},
                      {"contradicted", check.contradicted}});
    if (check.factor) checks.back()["factor"] = *check.factor;
    if (check.probability > 0) checks.back()["probability"] = check.probability;
    if (check.first_mission) checks.back()["first_mission"] = *check.first_mission;
    if (!check.few_missions.empty()) checks.back()["few_missions"] = check.few_missions;
  }
  return checks;
}

ordered_json baseline_to_json(const std::optional<Baseline>& baseline) {
  if (!baseline) return nullptr;
  ordered_json terms = ordered_json::object();
  for (const BaselineTerm& term : baseline->terms) {
    terms[term.name] = value_to_json(term.value, term.deviation, term.unit);
    terms[term.name]["model"] = json_number(term.model);
    terms[term.name]["explained"] = json_number(term.explained);
  }
  return {{"terms", std::move(terms)},
          {"held_out", json_number(baseline->held_out)},
          {"unchanged_model_held_out", json_number(baseline->unchanged_model_held_out)},
          {"explanation_held_out", json_number(baseline->explanation_held_out)},
          {"deviation", json_number(baseline->deviation)},
          {"wins", baseline->wins()},
          {"says", baseline->says}};
}

ordered_json where_to_json(const Diagnosis& d) {
  ordered_json regions = ordered_json::array();
  for (const WhereRegion& w : d.where) {
    const bool labelled = !w.label.empty();
    regions.push_back({{"channel", w.channel},
                       {"variable", w.variable},
                       {"from", labelled ? ordered_json(w.label) : ordered_json(json_number(w.from))},
                       {"to", labelled ? ordered_json(w.label) : ordered_json(json_number(w.to))},
                       {"share", json_number(w.share)},
                       {"ci", json_interval(w.interval)},
                       {"time_share", json_number(w.time_share)}});
  }
  return regions;
}

// What to inspect for the effect and for each alternative; covariates have no row.
std::string workshop_of(const DiagnosedEffect& effect) {
  std::vector<std::string> ids = effect.alternatives;
  ids.insert(ids.begin(), effect.id);
  std::string text;
  for (const std::string& id : ids) {
    const auto row = std::ranges::find(traits_table, id, &Traits::id);
    if (row != traits_table.end() && !row->workshop.empty())
      text.append(text.empty() ? "" : "; ").append(row->workshop);
  }
  return text;
}

ordered_json effects_to_json(const Diagnosis& d) {
  ordered_json effects = ordered_json::array();
  for (const DiagnosedEffect& e : d.effects) {
    ordered_json parameters = ordered_json::object();
    for (const DiagnosedParameter& p : e.parameters)
      parameters[p.name] = value_to_json(p.value, p.deviation, p.unit);
    effects.push_back({{"id", e.id},
                       {"probability", json_number(e.probability)},
                       {"parameters", std::move(parameters)},
                       {"share", json_number(e.share)},
                       {"alternatives", e.alternatives},
                       {"group", json_number(e.group)},
                       {"power_w", json_number(e.power_w)},
                       {"varies", json_number(e.varies)},
                       {"calibrates", text_or_null(e.calibrates)},
                       {"workshop", text_or_null(workshop_of(e))}});
  }
  return effects;
}

ordered_json outside_to_json(const Outside& o) {
  const bool stands_out = !o.channel.empty();
  return {{"probability", json_number(o.probability)},
          {"channel", text_or_null(o.channel)},
          {"follows", text_or_null(o.follows)},
          {"like", text_or_null(o.like)},
          {"power_w",
           o.power_w[0] != o.power_w[1] ? ordered_json(json_interval(o.power_w)) : ordered_json(nullptr)},
          {"says", text_or_null(stands_out ? outside_words(o) : "")}};
}

// Where nothing was added, before is after.
ordered_json shrinkage_to_json(const Diagnosis& d) {
  Shrinkage s;
  if (d.shrinkage) {
    s = *d.shrinkage;
  } else {
    s.before = s.after = d.power_absolute_relative;
    s.remaining_over_noise_floor = s.after / d.noise_floor;
  }
  return {{"held_out_before", json_number(s.before)},
          {"held_out_after", json_number(s.after)},
          {"fraction", json_number(s.fraction)},
          {"ci", json_interval(s.interval)},
          {"remaining_over_noise_floor", json_number(s.remaining_over_noise_floor)},
          {"parts", s.parts}};
}

ordered_json corrections_to_json(const Diagnosis& d) {
  ordered_json corrections = ordered_json::array();
  for (const FileCorrection& c : d.corrections) {
    corrections.push_back({{"parameter", c.parameter},
                           {"file", json_number(c.file)},
                           {"fits", json_number(c.fits)},
                           {"sd", json_number(c.deviation)}});
  }
  return corrections;
}

ordered_json sums_to_json(const Diagnosis& d) {
  ordered_json sums = ordered_json::array();
  for (const TermSum& s : d.sums) {
    sums.push_back({{"of", s.effects},
                    {"terms", s.terms},
                    {"value", json_number(s.difference_w)},
                    {"sd", json_number(s.deviation_w)},
                    {"unit", "W"},
                    {"adopts_as", text_or_null(s.parameter)},
                    {"fits", value_to_json(s.value, s.deviation, s.unit)}});
  }
  return sums;
}

ordered_json next_drive_to_json(const Diagnosis& d) {
  ordered_json drives = ordered_json::array();
  for (const NextDrive& n : d.next_drive) {
    drives.push_back({{"manoeuvre", n.manoeuvre},
                      {"separates", n.separates},
                      {"expected_log_evidence", json_number(n.expected_log_evidence)}});
  }
  return drives;
}

}  // namespace

ordered_json diagnosis_to_json(const Diagnosis& d) {
  ordered_json out;
  out["robot_id"] = d.robot_id;
  out["model_version"] = nullptr;
  out["missions"] = d.missions;
  out["samples"] = d.samples;
  out["notes"] = d.notes;
  out["motor_channels"] = d.motor_channels;
  out["power"] = name_of(d.power);
  out["checks"] = checks_to_json(d);
  out["gap"] = {{"energy_relative", json_number(d.energy_relative)},
                {"power_absolute_relative", json_number(d.power_absolute_relative)},
                {"noise_floor", json_number(d.noise_floor)},
                {"detectable_share", json_number(d.detectable_share)}};
  out["channels"] = channels_to_json(d);
  out["verdict"] = name_of(d.verdict);
  out["verdict_probability"] = json_number(d.verdict_probability);
  out["reasons"] = d.reasons;
  out["effects"] = effects_to_json(d);
  out["outside"] = outside_to_json(d.outside);
  out["shrinkage"] = shrinkage_to_json(d);
  out["baseline"] = baseline_to_json(d.baseline);
  out["sums"] = sums_to_json(d);
  out["corrections"] = corrections_to_json(d);
  out["where"] = where_to_json(d);
  out["next_drive"] = next_drive_to_json(d);
  out["adoption"] = offer_to_json(offer_of(d));
  if (d.figures.mean_power_w > 0) out["figures"] = figures_to_json(d.figures);
  return out;
}

}  // namespace joulecast::gap
