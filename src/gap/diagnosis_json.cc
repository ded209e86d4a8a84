#include "gap/diagnosis_json.h"

#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "gap/verdict_text.h"

namespace joulecast::gap {
using nlohmann::json;

json diagnosis_to_json(const Diagnosis& d) {
  json out;
  out["robot_id"] = d.robot_id;
  out["model_version"] = nullptr;
  out["missions"] = d.missions;
  out["samples"] = d.samples;
  out["motor_channels"] = d.motor_channels;
  out["power"] = name_of(d.power);
  out["gap"] = {{"energy_relative", json_number(d.energy_relative)},
                {"power_absolute_relative", json_number(d.power_absolute_relative)},
                {"noise_floor", json_number(d.noise_floor)}};
  out["where"] = json::array();
  for (const WhereRegion& w : d.where) {
    json region = {{"channel", w.channel},          {"variable", w.variable},
                   {"from", json_number(w.from)},   {"to", json_number(w.to)},
                   {"share", json_number(w.share)}, {"ci", json_interval(w.interval)}};
    if (!w.label.empty()) region["from"] = region["to"] = w.label;
    out["where"].push_back(std::move(region));
  }
  out["verdict"] = name_of(d.verdict);
  out["verdict_probability"] = json_number(d.verdict_probability);
  out["reasons"] = verdict_reasons(d);
  out["effects"] = json::array();
  for (const DiagnosedEffect& e : d.effects) {
    json parameters = json::object();
    for (const DiagnosedParameter& p : e.parameters) {
      parameters[p.name] = {
          {"value", json_number(p.value)}, {"sd", json_number(p.deviation)}, {"unit", p.unit}};
    }
    out["effects"].push_back({{"id", e.id},
                              {"probability", json_number(e.probability)},
                              {"parameters", std::move(parameters)},
                              {"share", json_number(e.share)},
                              {"alternatives", e.alternatives}});
  }
  const auto text = [](const std::string& s) { return s.empty() ? json(nullptr) : json(s); };
  out["outside"] = {{"probability", json_number(d.outside.probability)},
                    {"channel", text(d.outside.channel)},
                    {"follows", text(d.outside.follows)}};
  if (d.shrinkage) {
    out["shrinkage"] = {{"held_out_before", json_number(d.shrinkage->before)},
                        {"held_out_after", json_number(d.shrinkage->after)},
                        {"fraction", json_number(d.shrinkage->fraction)},
                        {"ci", json_interval(d.shrinkage->interval)},
                        {"remaining_over_noise_floor", json_number(d.shrinkage->remaining_over_noise_floor)}};
  } else {
    // Nothing was added: before is after.
    out["shrinkage"] = {
        {"held_out_before", json_number(d.power_absolute_relative)},
        {"held_out_after", json_number(d.power_absolute_relative)},
        {"fraction", 0.0},
        {"ci", json::array({0.0, 0.0})},
        {"remaining_over_noise_floor",
         d.noise_floor > 0 ? json_number(d.power_absolute_relative / d.noise_floor) : json(nullptr)}};
  }
  out["next_drive"] = json::array();
  for (const NextDrive& n : d.next_drive) {
    out["next_drive"].push_back({{"manoeuvre", n.manoeuvre},
                                 {"separates", n.separates},
                                 {"expected_log_evidence", json_number(n.expected_log_evidence)}});
  }
  return out;
}

std::string to_json_text(const Diagnosis& diagnosis, int indent) {
  return diagnosis_to_json(diagnosis).dump(indent);
}

}  // namespace joulecast::gap
