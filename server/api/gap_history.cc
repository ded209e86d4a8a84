#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_writer.h"
#include "base/utc_time.h"
#include "server/api/common_parameters.h"
#include "server/api/csv.h"
#include "server/api/services.h"

// The gap of a robot by mission, the models adopted over that time, and the gap of robots of its kind.
namespace joulecast::api {
namespace {

using http::Method;
using http::Parameter;
using http::Request;
using http::Response;
using Json = nlohmann::json;

constexpr std::int64_t max_gap_missions = 5000;

void write_ratios(JsonWriter& out, const std::vector<drift::MissionRatio>& missions) {
  out.key("missions").begin_array();
  for (const drift::MissionRatio& m : missions) {
    out.begin_object().field("id", m.mission_key).time("start", m.utime_us);
    out.field("model_version", m.model_version).field("measured_j", m.measured_j);
    out.field("modelled_j", m.modelled_j).field("ratio", m.ratio()).end_object();
  }
  out.end_array();
}

void write_marks(JsonWriter& out, const std::vector<drift::Mark>& marks) {
  out.key("drift").begin_array();
  for (const drift::Mark& m : marks) {
    out.begin_object().field("id", m.mission_key).time("start", m.utime_us);
    out.field("model_version", m.model_version).field("ratio_before", m.before).field("ratio_after", m.after);
    out.array("change_ci", m.interval);
    out.field("missions", static_cast<std::int64_t>(m.missions)).end_object();
  }
  out.end_array();
}

void write_versions(JsonWriter& out, const std::vector<history::ModelVersion>& versions) {
  out.key("versions").begin_array();
  for (const history::ModelVersion& v : versions) {
    out.begin_object().field("model_version", v.version).time("created", v.created_utime_us);
    out.field("origin", history::name(v.origin)).field("note", v.note).field("active", v.active);
    const Json evidence = Json::parse(v.evidence_json, nullptr, false);
    const Json test = evidence.is_object() ? evidence.value("back_test", Json::object()) : Json::object();
    for (const char* name : {"error_before", "error_after"}) {
      out.key(name);
      const auto found = test.find(name);
      found != test.end() && found->is_number() ? out.value(found->get<double>()) : out.null();
    }
    out.key("forced");
    evidence.is_object() ? out.value(evidence.value("forced", false)) : out.null();
    out.end_object();
  }
  out.end_array();
}

Response gap_history_csv(const Request& request, const std::vector<drift::MissionRatio>& missions) {
  Csv csv(request, {"id", "start", "start_utime_us", "model_version", "measured_j", "modelled_j", "ratio"});
  for (const drift::MissionRatio& m : missions) {
    csv.field(m.mission_key).field(utc_text(m.utime_us)).field(m.utime_us).field(m.model_version);
    csv.field(m.measured_j).field(m.modelled_j).field(m.ratio()).end_row();
  }
  return csv.response("robot-" + request.param("id") + "-gap-history");
}

Result<Response> gap_history(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  const auto model = model_of(services, id);
  if (!model) return tl::unexpected(model.error());
  const auto missions =
      services.drift.missions(id, static_cast<std::size_t>(request.query_integer("limit").value_or(500)));
  if (!missions) return tl::unexpected(missions.error());
  if (request.csv) return gap_history_csv(request, *missions);
  const auto marks = services.drift.marks(id);
  if (!marks) return tl::unexpected(marks.error());
  const auto siblings = services.drift.siblings(id);
  if (!siblings) return tl::unexpected(siblings.error());
  const auto versions = services.store.model_versions(id);
  if (!versions) return tl::unexpected(versions.error());

  JsonWriter out;
  out.begin_object().field("robot_id", id).field("model_version", (*model)->version);
  write_ratios(out, *missions);
  write_marks(out, *marks);
  write_versions(out, *versions);
  out.key("siblings").begin_array();
  for (const drift::SiblingRatio& s : *siblings) {
    out.begin_object().field("robot_id", s.robot_id).field("missions", static_cast<std::int64_t>(s.missions));
    out.field("ratio", s.ratio);
    out.array("ci", s.interval);
    out.field("deviation", s.deviation).field("stands_out", s.stands_out).end_object();
  }
  out.end_array().end_object();
  return http::json_response(out.take());
}

Response audit_csv(const Request& request, const std::vector<history::Event>& events,
                   std::string_view next_cursor) {
  Csv csv(request, {"id", "time", "utime_us", "robot_id", "kind", "detail"});
  for (const history::Event& e : events) {
    csv.field(e.id).field(utc_text(e.utime_us)).field(e.utime_us).field(e.robot_id).field(e.kind);
    csv.field(e.detail_json).end_row();
  }
  return csv.response("audit-log", request, next_cursor);
}

// The audit log: adoptions, drifts, diagnoses, mission ids that were used again.
Result<Response> list_audit_events(const Services& services, const Request& request) {
  std::optional<std::string> robot;
  if (const auto id = request.query_value("robot_id")) robot = std::string(*id);
  const auto cursor = id_cursor(request);
  if (!cursor) return tl::unexpected(cursor.error());
  const std::int64_t limit = request.query_integer("limit").value_or(100);
  const auto found = services.store.events(cursor->value_or(0), limit, robot);
  if (!found) return tl::unexpected(found.error());
  const auto id_of = [](const history::Event& e) { return e.id; };
  if (request.csv) return audit_csv(request, *found, next_id_cursor(*found, limit, id_of));
  JsonWriter out;
  out.begin_object().key("events").begin_array();
  for (const history::Event& e : *found) {
    out.begin_object().field("id", e.id).time("", e.utime_us).key("robot_id");
    e.robot_id.empty() ? out.null() : out.value(e.robot_id);
    out.field("kind", e.kind).key("detail").raw(e.detail_json).end_object();
  }
  out.end_array();
  write_id_cursor(out, *found, limit, id_of);
  out.end_object();
  return http::json_response(out.take());
}

}  // namespace

std::vector<TableRow> gap_history_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::get,
        .path = "/v1/robots/{id}/gap-history",
        .operation_id = "getGapHistory",
        .role = http::Role::read,
        .summary = "Measured over modelled energy of a robot's missions with marks where it drifted, the "
                   "models adopted, and the robots of its kind",
        .parameters = {limit_parameter("missions, newest first", max_gap_missions)},
        .response_schema = "gap-history",
        .csv = true,
        .rounded = true,
        .error_statuses = {404}},
       answered_by(gap_history)});
  return rows;
}

std::vector<TableRow> audit_log_rows() {
  using Type = Parameter::Type;
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::get,
        .path = "/v1/audit-log",
        .operation_id = "listAuditLog",
        .role = http::Role::read,
        .summary = "What happened to robots and their models: adoptions, drifts, diagnoses, reused mission "
                   "ids, in order",
        .parameters = {{.name = "robot_id", .type = Type::text, .description = "only of this robot"},
                       limit_parameter("entries a page", history::max_page_size),
                       cursor_parameter()},
        .response_schema = "audit-log",
        .csv = true},
       answered_by(list_audit_events)});
  return rows;
}

}  // namespace joulecast::api
