#include "history/records.h"

#include <nlohmann/json.hpp>

#include "base/json_number.h"

namespace joulecast::history {

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
  return json_text(all);
}

}  // namespace joulecast::history
