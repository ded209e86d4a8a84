#include "server/api/attention.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_writer.h"
#include "base/utc_time.h"
#include "server/api/robot_json.h"
#include "server/diagnosis/proposal_review.h"

namespace joulecast::api {
namespace {

using http::Method;
using http::Request;
using http::Response;

constexpr std::array<std::string_view, 3> severity_names = {"fault", "warning", "notice"};

std::string_view name_of(Severity severity) {
  return severity_names[static_cast<std::size_t>(severity)];
}

// Reasons by robot id; those of the service under the empty id.
using Reasons = std::map<std::string, std::vector<AttentionReason>>;

void add_telemetry(std::vector<AttentionReason>& reasons, const ingest::RobotSnapshot& s,
                   const ingest::ModelInForce* model, std::int64_t now_utime_us) {
  for (const ingest::Contradiction& c : s.contradictions) {
    std::string action = c.channel.empty() ? "Correct the robot's telemetry."
                                           : "Correct " + c.channel + " in the robot's telemetry.";
    if (c.untrue) action.append(" Until then its missions are not used for training.");
    reasons.push_back({"contradicted", Severity::fault, {}, c.says, std::move(action)});
  }
  const bool live = is_live(s, now_utime_us);
  if (!live && s.received_utime_us > 0 && !s.mission_id.empty())
    reasons.push_back({"silent", Severity::fault, s.received_utime_us,
                       fmt::format("No telemetry for {:.0f} s during mission {}.", silence_s(s, now_utime_us),
                                   s.mission_id),
                       "Check the robot's power and its network."});
  if (live && model == nullptr)
    reasons.push_back({"no_robot_file",
                       Severity::warning,
                       {},
                       "Telemetry of a robot without a robot file is not recorded.",
                       "Add its robot file: PUT /v1/robots/" + s.robot_id + "."});
  if (live && model != nullptr && !battery::at_charger(s.charge.phase) &&
      s.state_of_charge < model->robot.battery.reserve_fraction)  // false for NaN
    reasons.push_back({"charge_low",
                       Severity::warning,
                       {},
                       fmt::format("Charge {:.0f} %, below the reserve of {:.0f} %.", 100 * s.state_of_charge,
                                   100 * model->robot.battery.reserve_fraction),
                       "Send it to a charger."});
}

void add_watch(std::vector<AttentionReason>& reasons, const server::WatchFinding& found,
               std::int64_t version_in_force) {
  const auto change = [](double share) {
    return fmt::format("{:.1f} % {} energy", 100 * std::abs(share), share < 0 ? "less" : "more");
  };
  if (found.drift && found.drift->model_version == version_in_force) {
    const drift::Mark& mark = *found.drift;
    reasons.push_back({"drift", Severity::warning, mark.utime_us,
                       fmt::format("Uses {} than before {}.", change(mark.after / mark.before - 1),
                                   utc_text(mark.utime_us).substr(0, 10)),
                       "Start a diagnosis, or compare it with robots of its kind."});
  }
  if (found.among_kind && found.among_kind->stands_out)
    reasons.push_back({"stands_out",
                       Severity::notice,
                       {},
                       fmt::format("Uses {} than its model predicts, unlike the other robots of its kind.",
                                   change(found.among_kind->ratio - 1)),
                       "Check its payload, tyres and floor, or start a diagnosis."});
}

// The newest diagnosis of each robot, where it names effects and no model was adopted since.
Result<void> add_diagnoses(Reasons& reasons, const Services& services) {
  const auto found =
      services.store.diagnoses({}, std::numeric_limits<std::int64_t>::max(), history::max_page_size);
  if (!found) return tl::unexpected(found.error());
  std::set<std::string> seen;
  for (const history::DiagnosisRecord& d : *found) {
    if (d.state != history::DiagnosisState::done || !seen.insert(d.robot_id).second) continue;
    const auto model = services.models.find(d.robot_id);
    const auto summary = nlohmann::json::parse(d.summary_json, nullptr, false);
    if (model == nullptr || d.model_version != model->version || !summary.is_object() ||
        summary.value("verdict", "") != "effects")
      continue;
    std::string names;
    for (const auto& effect : summary["effects"])
      names += (names.empty() ? "" : ", ") + effect.value("id", std::string());
    reasons[d.robot_id].push_back({"gap_diagnosed", Severity::warning, d.finished_utime_us,
                                   fmt::format("Diagnosis {} names {}.", d.id, names),
                                   "Check the cause on the robot; adopt the corrected model if it holds."});
  }
  return {};
}

Result<void> add_proposals(Reasons& reasons, const Services& services) {
  const auto found =
      services.store.proposals({}, std::numeric_limits<std::int64_t>::max(), history::max_page_size);
  if (!found) return tl::unexpected(found.error());
  for (const history::Proposal& p : *found)
    if (const auto model = services.models.find(p.robot_id);
        model != nullptr && server::is_offered(p) &&
        p.base_version.value_or(model->version) == model->version)
      reasons[p.robot_id].push_back({"proposal", Severity::notice, p.created_utime_us,
                                     fmt::format("Proposal {}: {}.", p.id, p.note),
                                     "Review its back-test, then adopt or dismiss it."});
  return {};
}

void add_service(std::vector<AttentionReason>& reasons, const Services& services) {
  if (const history::WriterStatus status = services.writer.status(); !status.healthy)
    reasons.push_back({"store",
                       Severity::fault,
                       {},
                       "The store does not commit: " + status.error + ".",
                       "Check the disk or the database; the daemon retries automatically."});
  if (services.cluster == nullptr) return;
  if (const server::ClusterStatus status = services.cluster->status(); !status.error.empty())
    reasons.push_back({"cluster",
                       Severity::fault,
                       {},
                       "The cluster's database was not reached: " + status.error + ".",
                       "Check the database and the network between them."});
}

Result<Response> get_attention(const Services& services, const Request&) {
  const Result<std::vector<AttentionEntry>> found = attention(services);
  if (!found) return tl::unexpected(found.error());
  std::array<std::int64_t, severity_names.size()> counts{};
  JsonWriter json;
  json.begin_object().key("attention").begin_array();
  for (const AttentionEntry& entry : *found) {
    const Severity worst = entry.reasons.front().severity;
    ++counts[static_cast<std::size_t>(worst)];
    json.begin_object().key("robot_id");
    entry.robot_id.empty() ? json.null() : json.value(entry.robot_id);
    json.field("severity", name_of(worst)).key("reasons").begin_array();
    for (const AttentionReason& reason : entry.reasons) {
      json.begin_object().field("kind", reason.kind).field("severity", name_of(reason.severity));
      json.time("since", reason.since_utime_us);
      json.field("message", reason.message).field("action", reason.action).end_object();
    }
    json.end_array().end_object();
  }
  json.end_array().key("counts").begin_object();
  for (std::size_t k = 0; k < counts.size(); ++k) json.field(severity_names[k], counts[k]);
  json.end_object().end_object();
  return http::json_response(json.take());
}

}  // namespace

Result<std::vector<AttentionEntry>> attention(const Services& services) {
  Reasons reasons;
  const std::int64_t now_utime_us = services.now_utime_us();
  for (const auto& snapshot : services.fleet.all())
    add_telemetry(reasons[snapshot->robot_id], *snapshot, services.models.find(snapshot->robot_id).get(),
                  now_utime_us);
  for (const auto& [robot_id, found] : services.watch.findings())
    if (const auto model = services.models.find(robot_id))
      add_watch(reasons[robot_id], found, model->version);
  if (auto done = add_diagnoses(reasons, services); !done) return tl::unexpected(std::move(done.error()));
  if (auto done = add_proposals(reasons, services); !done) return tl::unexpected(std::move(done.error()));
  add_service(reasons[""], services);
  std::vector<AttentionEntry> entries;
  for (auto& [robot_id, found] : reasons) {
    if (found.empty()) continue;
    std::ranges::stable_sort(found, {}, &AttentionReason::severity);
    entries.push_back({robot_id, std::move(found)});
  }
  std::ranges::stable_sort(entries, {}, [](const AttentionEntry& e) { return e.reasons.front().severity; });
  return entries;
}

std::vector<TableRow> attention_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::get,
        .path = "/v1/attention",
        .operation_id = "listAttention",
        .role = http::Role::read,
        .summary = "Robots that need a person now, the most urgent first, each with its reasons and "
                   "what to do",
        .response_schema = "attention"},
       answered_by(get_attention)});
  return rows;
}

}  // namespace joulecast::api
