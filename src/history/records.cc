#include "history/records.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace joulecast::history {
namespace {

template <class Enum, std::size_t N>
std::optional<Enum> from(const std::array<std::string_view, N>& names, std::string_view text) {
  const auto found = std::find(names.begin(), names.end(), text);
  if (found == names.end()) return std::nullopt;
  return static_cast<Enum>(found - names.begin());
}

}  // namespace

std::string_view name(ModelOrigin origin) {
  return model_origin_names.at(static_cast<std::size_t>(origin));
}

std::string_view name(MissionState state) {
  return mission_state_names.at(static_cast<std::size_t>(state));
}

std::optional<ModelOrigin> model_origin_from(std::string_view text) {
  return from<ModelOrigin>(model_origin_names, text);
}

std::optional<MissionState> mission_state_from(std::string_view text) {
  return from<MissionState>(mission_state_names, text);
}

std::string_view name(DiagnosisState state) {
  return diagnosis_state_names.at(static_cast<std::size_t>(state));
}

std::optional<DiagnosisState> diagnosis_state_from(std::string_view text) {
  return from<DiagnosisState>(diagnosis_state_names, text);
}

std::string_view name(DiagnosisCause cause) {
  return diagnosis_cause_names.at(static_cast<std::size_t>(cause));
}

std::optional<DiagnosisCause> diagnosis_cause_from(std::string_view text) {
  return from<DiagnosisCause>(diagnosis_cause_names, text);
}

std::string_view name(ProposalState state) {
  return proposal_state_names.at(static_cast<std::size_t>(state));
}

std::optional<ProposalState> proposal_state_from(std::string_view text) {
  return from<ProposalState>(proposal_state_names, text);
}

MissionFindings findings_of(const Mission& mission) {
  MissionFindings parts;
  if (mission.findings_json.empty()) return parts;
  nlohmann::json all = nlohmann::json::parse(mission.findings_json, nullptr, false);
  if (!all.is_object()) return parts;
  const auto take = [&all](const char* key, std::string& part) {
    const auto found = all.find(key);
    if (found == all.end()) return;
    part = found->dump();
    all.erase(found);
  };
  take("contradictions", parts.contradictions);
  take("annulled", parts.annulled);
  if (!all.empty()) parts.motion = parts.teaches() ? mission.findings_json : all.dump();
  return parts;
}

std::string annulled_findings(const Mission& mission, std::int64_t utime_us, const std::string& reason) {
  nlohmann::json all = nlohmann::json::parse(mission.findings_json, nullptr, false);
  if (!all.is_object()) all = nlohmann::json::object();
  all["annulled"] = {{"utime_us", utime_us}, {"reason", reason}};
  return all.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace joulecast::history
