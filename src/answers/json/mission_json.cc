#include "answers/json/mission_json.h"

#include "answers/json/ledger_json.h"
#include "signals/account_ratios.h"

namespace joulecast::answers {

void write_mission(JsonWriter& json, const history::Mission& m) {
  json.begin_object();
  json.field("id", m.key);
  json.field("robot_id", m.robot_id);
  json.field("mission_id", m.mission_id);
  json.field("state", history::name(m.state));
  json.field("implicit", m.implicit);
  json.field("incomplete", m.incomplete);
  json.key("incomplete_reason");
  m.incomplete_reason.empty() ? json.null() : json.value(m.incomplete_reason);
  json.time("start", m.start_utime_us);
  json.time("end", m.end_utime_us);
  json.field("payload_kg", m.payload_kg);
  json.field("note", m.note);
  json.field("model_version", m.model_version);
  accounts_table().write(json.key("energy"), m.accounts);
  json.field("ratio", signals::energy_ratio(m.accounts));
  json.field("wh_per_km", signals::energy_per_distance_wh_km(m.accounts));
  json.field("samples", m.samples);
  json.key("sample_faults").begin_object();
  for (const auto& [reason, count] : m.sample_faults) json.field(reason, count);
  json.end_object();
  json.field("gap_count", m.gap_count);
  json.field("gap_s", m.gap_s);
  const history::MissionFindings findings = history::findings_of(m);
  json.key("findings");
  findings.motion.empty() ? json.null() : json.raw(findings.motion);
  json.key("contradictions").raw(findings.contradictions);
  json.key("annulled");
  findings.annulled.empty() ? json.null() : json.raw(findings.annulled);
  json.key("covariates").begin_array();
  for (const history::CovariateSummary& c : m.covariates) {
    json.begin_object().field("name", c.name).field("mean", c.mean).field("min", c.min).field("max", c.max);
    json.field("known_s", c.known_s).end_object();
  }
  json.end_array();
  json.end_object();
}

}  // namespace joulecast::answers
