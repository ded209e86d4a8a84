#include <cmath>
#include <nlohmann/json.hpp>

#include "gap/mission_level.h"

namespace joulecast::gap {
namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

json left_out(const LeftOut& l) {
  return {{"left_out", l.what},
          {"runs", l.runs},
          {"error_before", number(l.before)},
          {"error_after", number(l.after)},
          {"fraction", l.before > 0 ? json(1 - l.after / l.before) : json(nullptr)},
          {"ci", json::array({number(l.interval[0]), number(l.interval[1])})}};
}

json parameters_of(const DiagnosedEffect& e) {
  json parameters = json::object();
  for (const DiagnosedParameter& p : e.parameters)
    parameters[p.name] = {{"value", number(p.value)}, {"sd", number(p.deviation)}, {"unit", p.unit}};
  return parameters;
}

}  // namespace

json to_json(const MissionDiagnosis& d) {
  json out;
  out["robot_id"] = d.robot_id;
  out["kind"] = "mission_energies";
  out["missions"] = d.runs.size();
  out["model"] = {{"given", d.model_given}, {"given_over_robot_file", number(d.model_ratio)}};
  out["gap"] = {{"energy_relative", number(d.energy_relative)},
                {"mean_absolute_error", number(d.error)},
                {"noise_floor", number(d.scatter)}};
  out["scatter"] = {{"run", number(d.scatters.run)},
                    {"side_difference", number(d.scatters.difference)},
                    {"table", number(d.scatters.table)}};
  out["verdict"] = name_of(d.verdict);
  out["verdict_probability"] = number(d.verdict_probability);
  out["effects"] = json::array();
  for (const DiagnosedEffect& e : d.effects) {
    out["effects"].push_back({{"id", e.id},
                              {"probability", number(e.probability)},
                              {"parameters", parameters_of(e)},
                              {"share", number(e.share)},
                              {"alternatives", e.alternatives}});
  }
  out["outside"] = {{"probability", number(d.outside_probability)},
                    {"follows", d.outside.empty() ? json(nullptr) : json(d.outside)}};
  out["shrinkage"] = left_out(d.left_out);
  out["shrinkage"]["folds"] = d.folds;
  out["shrinkage"]["folds_with_the_same_effects"] = d.folds_agreeing;
  out["left_out_conditions"] = json::array();
  for (const LeftOut& l : d.conditions) {
    out["left_out_conditions"].push_back(left_out(l));
    out["left_out_conditions"].back()["effects"] = l.effects;
  }
  out["turning_term"] = nullptr;
  if (d.turning) {
    const TurningTerm& t = *d.turning;
    out["turning_term"] = {{"runs", t.runs},
                           {"would_move_side_difference", number(t.side_difference)},
                           {"would_move_sum", number(t.sum)},
                           {"found", {{"value", number(t.share)}, {"sd", number(t.share_sd)}, {"unit", "1"}}},
                           {"motor_error_before", number(t.motor_error_before)},
                           {"motor_error_after", number(t.motor_error_after)}};
  }
  out["limits"] = d.limits;
  out["not_visible"] = d.not_visible;
  out["runs"] = json::array();
  for (const JudgedRun& r : d.runs) {
    out["runs"].push_back({{"run", r.run.label},
                           {"table", r.run.table},
                           {"payload_kg", number(r.run.at.payload_kg)},
                           {"measured_j", number(r.run.measured_j())},
                           {"model_j", number(r.model_j)},
                           {"with_effects_j", number(r.after_j)},
                           {"held_out_j", number(r.held_out_j)}});
  }
  return out;
}

}  // namespace joulecast::gap
