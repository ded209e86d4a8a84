#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "gap/mission_level.h"

namespace joulecast::gap {
namespace {

using nlohmann::json;

json left_out(const LeftOut& l) {
  return {{"left_out", l.what},
          {"runs", l.runs},
          {"error_before", json_number(l.before)},
          {"error_after", json_number(l.after)},
          {"fraction", l.before > 0 ? json(1 - l.after / l.before) : json(nullptr)},
          {"ci", json::array({json_number(l.interval[0]), json_number(l.interval[1])})}};
}

json parameters_of(const DiagnosedEffect& e) {
  json parameters = json::object();
  for (const DiagnosedParameter& p : e.parameters)
    parameters[p.name] = {
        {"value", json_number(p.value)}, {"sd", json_number(p.deviation)}, {"unit", p.unit}};
  return parameters;
}

}  // namespace

json to_json(const MissionDiagnosis& d) {
  json out;
  out["robot_id"] = d.robot_id;
  out["kind"] = "mission_energies";
  out["missions"] = d.runs.size();
  out["model"] = {{"given", d.model_given}, {"given_over_robot_file", json_number(d.model_ratio)}};
  out["gap"] = {{"energy_relative", json_number(d.energy_relative)},
                {"mean_absolute_error", json_number(d.error)},
                {"noise_floor", json_number(d.scatter)}};
  out["scatter"] = {{"run", json_number(d.scatters.run)},
                    {"side_difference", json_number(d.scatters.difference)},
                    {"table", json_number(d.scatters.table)}};
  out["verdict"] = name_of(d.verdict);
  out["verdict_probability"] = json_number(d.verdict_probability);
  out["effects"] = json::array();
  for (const DiagnosedEffect& e : d.effects) {
    out["effects"].push_back({{"id", e.id},
                              {"probability", json_number(e.probability)},
                              {"parameters", parameters_of(e)},
                              {"share", json_number(e.share)},
                              {"alternatives", e.alternatives}});
  }
  out["outside"] = {{"probability", json_number(d.outside_probability)},
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
    out["turning_term"] = {
        {"runs", t.runs},
        {"would_move_side_difference", json_number(t.side_difference)},
        {"would_move_sum", json_number(t.sum)},
        {"found", {{"value", json_number(t.share)}, {"sd", json_number(t.share_sd)}, {"unit", "1"}}},
        {"motor_error_before", json_number(t.motor_error_before)},
        {"motor_error_after", json_number(t.motor_error_after)}};
  }
  out["limits"] = d.limits;
  out["not_visible"] = d.not_visible;
  out["runs"] = json::array();
  for (const JudgedRun& r : d.runs) {
    out["runs"].push_back({{"run", r.run.label},
                           {"table", r.run.table},
                           {"payload_kg", json_number(r.run.at.payload_kg)},
                           {"measured_j", json_number(r.run.measured_j())},
                           {"model_j", json_number(r.model_j)},
                           {"with_effects_j", json_number(r.after_j)},
                           {"held_out_j", json_number(r.held_out_j)}});
  }
  return out;
}

}  // namespace joulecast::gap
