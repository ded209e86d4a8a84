#include "gap/diagnosis_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace joulecast::gap {
namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

json interval(const std::array<double, 2>& ends) {
  return json::array({number(ends[0]), number(ends[1])});
}

}  // namespace

json diagnosis_to_json(const Diagnosis& d) {
  json out;
  out["robot_id"] = d.robot_id;
  out["model_version"] = nullptr;
  out["missions"] = d.missions;
  out["samples"] = d.samples;
  out["motor_channels"] = d.motor_channels;
  out["power"] = name_of(d.power);
  out["gap"] = {{"energy_relative", number(d.energy_relative)},
                {"power_absolute_relative", number(d.power_absolute_relative)},
                {"noise_floor", number(d.noise_floor)}};
  out["where"] = json::array();
  for (const WhereRegion& w : d.where) {
    json region = {{"channel", w.channel}, {"variable", w.variable},   {"from", number(w.from)},
                   {"to", number(w.to)},   {"share", number(w.share)}, {"ci", interval(w.interval)}};
    if (!w.label.empty()) region["from"] = region["to"] = w.label;
    out["where"].push_back(std::move(region));
  }
  out["verdict"] = name_of(d.verdict);
  out["verdict_probability"] = number(d.verdict_probability);
  out["effects"] = json::array();
  for (const DiagnosedEffect& e : d.effects) {
    json parameters = json::object();
    for (const DiagnosedParameter& p : e.parameters) {
      parameters[p.name] = {{"value", number(p.value)}, {"sd", number(p.deviation)}, {"unit", p.unit}};
    }
    out["effects"].push_back({{"id", e.id},
                              {"probability", number(e.probability)},
                              {"parameters", std::move(parameters)},
                              {"share", number(e.share)},
                              {"alternatives", e.alternatives}});
  }
  const auto text = [](const std::string& s) { return s.empty() ? json(nullptr) : json(s); };
  out["outside"] = {{"probability", number(d.outside.probability)},
                    {"channel", text(d.outside.channel)},
                    {"follows", text(d.outside.follows)}};
  if (d.shrinkage) {
    out["shrinkage"] = {{"held_out_before", number(d.shrinkage->before)},
                        {"held_out_after", number(d.shrinkage->after)},
                        {"fraction", number(d.shrinkage->fraction)},
                        {"ci", interval(d.shrinkage->interval)},
                        {"remaining_over_noise_floor", number(d.shrinkage->remaining_over_noise_floor)}};
  } else {
    // Nothing was added: before is after.
    out["shrinkage"] = {
        {"held_out_before", number(d.power_absolute_relative)},
        {"held_out_after", number(d.power_absolute_relative)},
        {"fraction", 0.0},
        {"ci", json::array({0.0, 0.0})},
        {"remaining_over_noise_floor",
         d.noise_floor > 0 ? number(d.power_absolute_relative / d.noise_floor) : json(nullptr)}};
  }
  out["next_drive"] = json::array();
  for (const NextDrive& n : d.next_drive) {
    out["next_drive"].push_back({{"manoeuvre", n.manoeuvre},
                                 {"separates", n.separates},
                                 {"expected_log_evidence", number(n.expected_log_evidence)}});
  }
  return out;
}

std::string to_json_text(const Diagnosis& diagnosis, int indent) {
  return diagnosis_to_json(diagnosis).dump(indent);
}

}  // namespace joulecast::gap
