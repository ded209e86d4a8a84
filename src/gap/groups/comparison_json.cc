#include "gap/groups/comparison_json.h"

#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {
namespace {

using nlohmann::ordered_json;

ordered_json difference_to_json(const Comparison& c) {
  if (!c.difference) return nullptr;
  const GroupDifference& d = *c.difference;
  ordered_json by_effect = ordered_json::object();
  for (std::size_t k = 0; k < c.effects.size(); ++k)
    by_effect[c.effects[k].id] = json_number(d.by_effect_j[k]);
  return {{"from", c.groups[d.from].name},
          {"to", c.groups[d.to].name},
          {"energy_per_m_j", json_number(d.energy_per_m_j)},
          {"by_motion_j", json_number(d.by_motion_j)},
          {"by_effect_j", std::move(by_effect)},
          {"unexplained_j", json_number(d.unexplained_j)}};
}

}  // namespace

ordered_json comparison_to_json(const Comparison& c) {
  ordered_json out = diagnosis_to_json(c.diagnosis);
  out["kind"] = "comparison";
  out["groups"] = ordered_json::array();
  for (const ComparedGroup& g : c.groups) {
    out["groups"].push_back({{"name", g.name},
                             {"missions", g.missions},
                             {"samples", g.samples},
                             {"way_m", json_number(g.way_m)},
                             {"energy_per_m_j", json_number(g.energy_per_m_j)},
                             {"model_per_m_j", json_number(g.model_per_m_j)}});
  }
  out["common"] = c.common;
  out["strengths"] = ordered_json::array();
  for (const ComparedEffect& e : c.effects) {
    ordered_json groups = ordered_json::object();
    for (std::size_t g = 0; g < e.groups.size(); ++g) {
      groups[c.groups[g].name] = {{"value", json_number(e.groups[g].value)},
                                  {"sd", json_number(e.groups[g].deviation)},
                                  {"energy_per_m_j", json_number(e.groups[g].energy_per_m_j)}};
    }
    out["strengths"].push_back(
        {{"id", e.id}, {"parameter", e.parameter}, {"unit", e.unit}, {"groups", std::move(groups)}});
  }
  out["difference"] = difference_to_json(c);
  out["limits"] = c.limits;
  return out;
}

}  // namespace joulecast::gap
