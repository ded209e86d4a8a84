#include <nlohmann/json.hpp>
#include <utility>

#include "answers/mission.h"
#include "base/json_writer.h"
#include "base/try.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// The gap of a robot by mission, the models adopted over that time, and the gap of robots of its kind.
namespace joulecast::api {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t max_gap_missions = 5000;
constexpr std::string_view usual_event_order = "asc";

struct GapHistory {
  std::string robot_id;
  std::int64_t model_version = 0;
  std::vector<drift::MissionRatio> missions;
  std::vector<drift::Mark> marks;
  std::vector<history::ModelVersion> versions;
  std::vector<drift::SiblingRatio> siblings;
};

constexpr std::string_view start_words = "start of the mission, microseconds since 1970 by the robot's clock";
constexpr std::string_view version_words = "the version then in force";
constexpr std::string_view robot_words = "the robot's id, as in its telemetry and its file";

// Of the back-test with which the version was adopted.
std::optional<double> error_of(const history::ModelVersion& version, const char* name) {
  const Json evidence = Json::parse(version.evidence_json, nullptr, false);
  const Json test = evidence.is_object() ? evidence.value("back_test", Json::object()) : Json::object();
  const auto found = test.find(name);
  return found != test.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

std::optional<bool> was_forced(const history::ModelVersion& version) {
  const Json evidence = Json::parse(version.evidence_json, nullptr, false);
  return evidence.is_object() ? std::optional(evidence.value("forced", false)) : std::nullopt;
}

const auto listed_version_table =
    Table<history::ModelVersion>()
        .value("model_version", AT(version), version_words)
        .time("created", AT(created_utime_us),
              "time of creation, microseconds since 1970 by the host's clock")
        .value(
            "origin", [](const auto& version) { return history::name(version.origin); },
            "where the model came from")
        .value("note", AT(note), "note of its author")
        .value("active", AT(active), "whether it is in force")
        .value(
            "error_before", [](const auto& version) { return error_of(version, "error_before"); },
            "of the back-test with which it was adopted: error of the version before; null: none")
        .value(
            "error_after", [](const auto& version) { return error_of(version, "error_after"); },
            "the same with this version")
        .value("forced", was_forced,
               "true: adopted although the back-test showed no improvement; null: adopted without a "
               "back-test");

const auto ratio_table =
    Table<drift::MissionRatio>()
        .value("id", AT(mission_key), "as in /v1/missions/{id}")
        .time("start", AT(utime_us), start_words)
        .value("model_version", AT(model_version), version_words)
        .value("measured_j", AT(measured_j), "energy from the battery by the sensors of voltage and current")
        .value("modelled_j", AT(modelled_j), "where measured")
        .value("ratio", AT(ratio()), "measured / modelled");

const auto sibling_table =
    Table<drift::SiblingRatio>()
        .value("robot_id", AT(robot_id), robot_words)
        .value("missions", AT(missions), "number of missions")
        .value("ratio", AT(ratio), "median of measured over modelled energy")
        .numbers("ci", AT(interval), "95 % interval")
        .value("deviation", AT(deviation), "robust standard deviations from the kind's median")
        .value("stands_out", AT(stands_out), "whether it differs significantly from the others");
const auto gap_history_table =
    Table<GapHistory>("A robot's gap by mission")
        .value("robot_id", AT(robot_id), robot_words)
        .value("model_version", AT(model_version), "version in force")
        .list("missions", AT(missions), "measured over modelled energy of each mission, oldest first",
              ratio_table)
        .list("drift", AT(marks), "detected changes of the robot", answers::mark_table())
        .list("versions", AT(versions), "versions of the model, newest first", listed_version_table)
        .list("siblings", AT(siblings), "robots of this kind, this one among them", sibling_table);

Result<Response> gap_history(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY_ASSIGN(const auto model, model_of(services, id));
  TRY_ASSIGN(auto missions,
             services.drift.missions(id, static_cast<std::size_t>(*request.query_integer("limit"))));
  if (request.csv)
    return csv_response(request, "robot-" + id + "-gap-history",
                        "id start start_utime_us model_version measured_j modelled_j ratio", missions,
                        ratio_table);
  TRY_ASSIGN(auto marks, services.drift.marks(id));
  TRY_ASSIGN(auto siblings, services.drift.siblings(id));
  TRY_ASSIGN(auto versions, services.store.model_versions(id));
  return http::json_response(gap_history_table.text(
      {id, model->version, std::move(missions), std::move(marks), std::move(versions), std::move(siblings)}));
}

const auto event_table =
    Table<history::Event>()
        .value("id", AT(id), "number of the entry, ascending")
        .time("", AT(utime_us), "time of the event, microseconds since 1970 by the host's clock")
        .text_or_null("robot_id", AT(robot_id), "robot of the event; null: none")
        .value("kind", AT(kind), "kind of event, e.g. gap_drift or model_adopted")
        .json("detail", AT(detail_json), "details; the members depend on kind", described::of_type("object"));

// The event log: adoptions, drifts, diagnoses, mission ids that were used again.
Result<Response> list_events(const Services& services, const Request& request) {
  TRY_ASSIGN(const LogQuery query, log_query(request, usual_event_order));
  TRY_ASSIGN(const auto found, services.store.events(query.behind_id, query.limit, query.filter));
  const std::string next = next_id_cursor(found, query.limit, &history::Event::id);
  if (request.csv)
    return csv_response(request, "event-log", "id time utime_us robot_id kind detail", found, event_table,
                        next);
  return page_response("events", found, event_table, next);
}

}  // namespace

Part gap_history_part() {
  Part part;
  part.add(Method::get, "/v1/robots/{id}/gap-history", "getGapHistory", Role::read,
           "Measured over modelled energy of a robot's missions with marks where it drifted, the models "
           "adopted, and the robots of its kind",
           {"gap-history", gap_history_table.schema()}, gap_history,
           {.parameters = {limit_parameter("missions, newest first", 500, max_gap_missions)},
            .csv = true,
            .rounded = true,
            .error_statuses = {404}});
  return part;
}

Part event_log_part() {
  Part part;
  part.add(
      Method::get, "/v1/event-log", "listEventLog", Role::read,
      "What happened to robots and their models: adoptions, drifts, diagnoses, reused mission ids",
      {"event-log", described::of_page("Entries of the event log", "events", "in the requested order",
                                       event_table.of_member())},
      list_events,
      {.former_path = "/v1/audit-log",
       .parameters = with({{.name = "robot_id",
                            .description = "only entries of this robot, or of these, separated by commas"}},
                          log_parameters("only entries of this kind", usual_event_order)),
       .csv = true});
  return part;
}

}  // namespace joulecast::api
