#include "gap/runs/runs_json.h"

#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {
namespace {

using nlohmann::ordered_json;

ordered_json conditions_to_json(const std::vector<LeftOut>& conditions) {
  ordered_json all = ordered_json::array();
  for (const LeftOut& l : conditions) {
    all.push_back({{"left_out", l.what},
                   {"runs", l.runs},
                   {"held_out_before", json_number(l.before)},
                   {"held_out_after", json_number(l.after)},
                   {"baseline_held_out", json_number(l.referee)},
                   {"fraction", json_number(1 - l.after / l.before)},
                   {"ci", {json_number(l.interval[0]), json_number(l.interval[1])}},
                   {"effects", l.effects}});
  }
  return all;
}

}  // namespace

ordered_json runs_to_json(const RunDiagnosis& r) {
  ordered_json out = diagnosis_to_json(r.diagnosis);
  out["kind"] = "mission_energies";
  out["model"] = {{"given", r.model_given}, {"given_over_robot_file", json_number(r.model_ratio)}};
  out["scatter"] = {{"run", json_number(r.scatter)}, {"side_difference", json_number(r.side_scatter)}};
  out["left_out_conditions"] = conditions_to_json(r.conditions);
  out["limits"] = r.limits;
  out["not_visible"] = r.not_visible;
  out["runs"] = ordered_json::array();
  for (const JudgedRun& run : r.runs) {
    out["runs"].push_back({{"run", run.run.name},
                           {"table", run.run.table},
                           {"measured_j", json_number(run.run.measured_j())},
                           {"model_j", json_number(run.model_j)},
                           {"with_effects_j", json_number(run.after_j)},
                           {"held_out_j", json_number(run.held_out_j)}});
  }
  return out;
}

}  // namespace joulecast::gap
