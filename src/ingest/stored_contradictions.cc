#include "ingest/stored_contradictions.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace joulecast::ingest {
namespace {

std::vector<Contradiction> contradictions_in(const std::string& findings_json) {
  const nlohmann::json findings = nlohmann::json::parse(findings_json, nullptr, false);
  std::vector<Contradiction> found;
  if (!findings.is_object() || !findings.contains("contradictions")) return found;
  for (const nlohmann::json& each : findings["contradictions"]) {
    if (!each.is_object()) continue;
    const auto kind = std::ranges::find(contradiction_kind_names, each.value("kind", ""));
    if (kind == contradiction_kind_names.end()) continue;
    Contradiction& c = found.emplace_back();
    c.kind = static_cast<ContradictionKind>(kind - contradiction_kind_names.begin());
    c.id = each.value("id", "");
    c.channel = each.value("channel", "");
    const auto value = each.find("value");
    c.value = value != each.end() && value->is_number() ? value->get<double>() : signals::unmeasured;
    c.says = each.value("says", "");
    c.untrue = true;
  }
  return found;
}

}  // namespace

std::vector<Contradiction> stored_contradictions(const history::Store& store, const std::string& robot_id) {
  using history::MissionState;
  history::MissionFilter ended;
  ended.robot_ids = {robot_id};
  ended.states = {MissionState::finished, MissionState::aborted, MissionState::superseded,
                  MissionState::unfinished, MissionState::interrupted};
  const auto last = store.missions(ended, {.limit = 1, .cursor = {}});
  if (!last || last->missions.empty()) return {};
  const history::Mission& mission = last->missions.front();
  std::vector<Contradiction> found = contradictions_in(mission.findings_json);
  for (Contradiction& c : found) c.told_utime_us = mission.end_utime_us;
  return found;
}

}  // namespace joulecast::ingest
