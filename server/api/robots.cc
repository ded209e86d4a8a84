#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <ranges>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/try.h"
#include "ingest/fleet_view.h"
#include "robot/review.h"
#include "robot/robot_file.h"
#include "server/api/change.h"
#include "server/api/common_parameters.h"
#include "server/api/robot_json.h"
#include "server/api/services.h"

// Robots: their models, their live state, and the last 90 s of live values, with which a page fills its
// charts when it opens.
namespace joulecast::api {
namespace {

constexpr std::int64_t max_listed_robots = 10'000;  // a page

void write_robot_state(JsonWriter& json, const Services& services, const std::string& robot_id) {
  const auto model = services.models.find(robot_id);
  const auto kept = services.fleet.find(robot_id);
  ingest::RobotSnapshot state;
  if (kept != nullptr) state = *kept;
  // Without telemetry since the start, the state is the last stored one; the model may have changed since.
  if (kept == nullptr || kept->samples == 0) {
    state.robot_id = robot_id;
    state.has_model = model != nullptr;
    state.model_version = model != nullptr ? model->version : 0;
  }
  std::optional<forecast::Reach> reach;
  if (model != nullptr) reach = services.forecasts.reach(model, state);
  state_table().write(json, {state, reach, services.now_utime_us()});
}

Result<Response> list_robots(const Services& services, const Request& request) {
  std::set<std::string> ids;
  for (const auto& model : services.models.all()) ids.insert(model->robot.robot_id);
  for (const auto& snapshot : services.fleet.all()) ids.insert(snapshot->robot_id);
  const auto [page, next] = page_of_ids(request, ids);
  const auto write = [&](JsonWriter& json, const std::string& id) { write_robot_state(json, services, id); };
  if (request.csv)
    return csv_response(
        request, "robots",
        "robot_id live silent_s time utime_us has_model model_version measured_power_w modelled_power_w "
        "speed_m_s yaw_rate_rad_s x_m=pose/0 y_m=pose/1 heading_rad=pose/2 payload_kg battery_voltage_v "
        "battery_current_a state_of_charge state_of_charge_sd range_m run_time_s mission/mission_id samples",
        page, write, next);
  return page_response("robots", page, write, next);
}

using history::ModelVersion;

constexpr const char* id_of_robot_words = "the robot's id, as in its telemetry and its file";
constexpr const char* created_words = "time of creation, microseconds since 1970 by the host's clock";

std::string_view origin_of(const ModelVersion& version) {
  return history::name(version.origin);
}

const auto detail_table =
    Table<ModelVersion>("A robot and its model in force")
        .value("robot_id", AT(robot_id), id_of_robot_words)
        .value("model_version", AT(version), "version in force")
        .word("origin", origin_of, history::names_of<history::ModelOrigin>, "where the model came from")
        .time("created", AT(created_utime_us), created_words)
        .compact_json("model", AT(model_json), "the robot file, robot.schema.json",
                      described::of_type("object"));

const auto version_table =
    Table<ModelVersion>("A version of a robot's model")
        .named("model")
        .value("model_version", AT(version), "number of the version")
        .time("created", AT(created_utime_us), created_words)
        .value("origin", origin_of, "where the model came from")
        .value("note", AT(note), "note of its author")
        .value("active", AT(active), "whether it is in force")
        .value("parent_version", AT(parent_version), "version from which it was derived; null: none")
        .compact_json("model", AT(model_json), "the model, as a robot file", described::of_type("object"))
        .json("evidence", AT(evidence_json),
              "basis of its adoption: its back-test, and its diagnosis or proposal",
              described::of_type("object", true));

// The answer to a robot file that was stored.
struct Stored {
  std::string robot_id;
  std::int64_t version;
  const std::vector<robot::ReviewFinding>& findings;
};

const auto warning_table = Table<robot::ReviewFinding>()
                               .value("field", AT(field), "JSON pointer into the model")
                               .value("value", AT(value), "the value, in the unit given in `says`")
                               .value("says", AT(says), "the same in a sentence");
const auto stored_table =
    Table<Stored>("Version of a stored robot model")
        .value("robot_id", AT(robot_id), id_of_robot_words)
        .value("model_version", AT(version), "version that is in force now")
        .list("warnings", AT(findings),
              "values of the model that are within all bounds but implausible; empty: none", warning_table);

struct Removal {
  std::string robot_id;
  std::string history;
  std::int64_t missions;
};

const auto removal_table =
    Table<Removal>("Result of removing a robot")
        .value("robot_id", AT(robot_id), "the robot that was removed")
        .word("history", AT(history), std::array{"keep", "purge"},
              "whether its missions and models are kept or deleted")
        .value("missions_deleted", AT(missions), "missions deleted with it", {{"minimum", 0}});

Result<Response> get_robot(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  TRY_ASSIGN(const history::ModelVersion model, services.store.model(id));
  return http::json_response(detail_table.text(model));
}

// Faults and suspicious values of a robot file, and the figures that follow from a correct one.
struct RobotCheck {
  std::vector<robot::ReviewFinding> findings;
  robot::Figures figures{signals::unmeasured, signals::unmeasured, signals::unmeasured, signals::unmeasured};
};

const auto finding_table =
    Table<robot::ReviewFinding>()
        .value("fault", AT(fault), "true: the file is not accepted; false: suspicious only")
        .value("field", AT(field), "JSON pointer into the file")
        .value("says", AT(says), "the fault in a sentence");
const auto check_table =
    Table<RobotCheck>("Review of a robot file")
        .list("findings", AT(findings), "faults first; empty: none", finding_table)
        .number_or_null("top_speed_m_s", AT(figures.top_speed_m_s),
                        "speed that the motors reach on the flat; these and the following are null if the "
                        "file is not accepted")
        .number_or_null("acceleration_m_s2", AT(figures.acceleration_m_s2),
                        "greatest acceleration from standing")
        .number_or_null("energy_wh", AT(figures.energy_wh), "energy of a full battery, Wh")
        .number_or_null("standing_h", AT(figures.standing_h),
                        "time that a full battery lasts at idle power, h; null: unlimited");

Result<Response> check_file(const Services&, const Request& request) {
  RobotCheck check;
  for (const FieldFault& problem : robot::problems_of(*request.json))
    check.findings.push_back({true, problem.field, 0, problem.says});
  if (check.findings.empty()) {
    TRY_ASSIGN(const robot::RobotModel model, robot::read_robot(*request.json));
    if (const auto effects = dynamics::active_effects(model); !effects)
      check.findings.push_back({true, effects.error().field, 0, effects.error().message});
    const auto reviewed = robot::review(model);
    check.findings.insert(check.findings.end(), reviewed.begin(), reviewed.end());
    check.figures = robot::figures_of(model);
  }
  return http::json_response(check_table.text(check));
}

Result<Response> put(Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY_ASSIGN(const robot::RobotModel robot, robot::parse_robot(request.body));
  if (robot.robot_id != id)
    return invalid("/robot_id",
                   "is \"" + robot.robot_id + "\", must equal the id in the path, \"" + id + "\"");
  // The catalogue's bounds are checked before anything is stored.
  TRY(dynamics::active_effects(robot));
  const std::vector<robot::ReviewFinding> findings = robot::review(robot);
  TRY(robot::plannable(findings));
  RequestChange change(services, request);
  return change.result(services.adoption.put(robot, change.answered_by([id, findings](std::int64_t version) {
    return http::json_response(stored_table.text({id, version, findings}));
  })));
}

// Waits until the robot's session has ended, with no data left to store. False on timeout.
bool wait_for_end_of_session(const Services& services, const std::string& id) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  for (;;) {
    const auto snapshot = services.fleet.find(id);
    if (snapshot == nullptr || !snapshot->has_model) return true;
    if (std::chrono::steady_clock::now() >= until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

Result<Response> remove(Services& services, const Request& request) {
  const std::string& id = request.param("id");
  const std::string history(request.query_value("history").value_or("keep"));
  TRY_ASSIGN(const auto robots, services.store.robots());
  if (std::ranges::find(robots, id, &history::RobotRecord::robot_id) == robots.end())
    return tl::unexpected(ingest::unknown_robot("id", id));
  if (services.diagnoses.waits_or_runs(id))
    return fail(Fault::conflict, "id", "a diagnosis of robot " + id + " waits or runs; cancel it first");
  const auto model = services.models.find(id);
  if (model == nullptr && history == "keep")
    return fail(Fault::not_found, "id",
                "robot " + id + " has no model in force; history=purge deletes its stored data");
  services.models.remove(id);
  RequestChange request_change(services, request);
  history::Change change = request_change.answered_by(
      [id, history](std::int64_t missions) {
        return http::json_response(removal_table.text({id, history, missions}));
      },
      history::RemoveRobot{id, history == "purge"});
  change.add_before([id, history, now = services.now_utime_us()](std::int64_t missions) {
    JsonWriter detail;
    detail.begin_object().field("history", history).field("missions_deleted", missions).end_object();
    return std::vector<history::Command>{history::AppendEvent{{0, now, id, "robot_removed", detail.take()}}};
  });
  const history::Outcome done =
      wait_for_end_of_session(services, id)
          ? services.writer.execute(std::move(change))
          : fail(Fault::unavailable, "", "telemetry of the robot is still being stored; try again later");
  if (!done && model != nullptr) services.models.put_back(model);
  return request_change.result(done);
}

Result<Response> state(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  if (services.models.find(id) == nullptr && services.fleet.find(id) == nullptr)
    return tl::unexpected(ingest::unknown_robot("id", id));
  JsonWriter json;
  write_robot_state(json, services, id);
  return http::json_response(json.take());
}

Result<Response> versions(const Services& services, const Request& request) {
  TRY(model_of(services, request.param("id")));
  TRY_ASSIGN(const std::vector<history::ModelVersion> found,
             services.store.model_versions(request.param("id")));
  TRY_ASSIGN(const auto cursor, id_cursor(request));
  const auto limit = static_cast<std::size_t>(*request.query_integer("limit"));
  const auto is_next = [&](const history::ModelVersion& v) { return !cursor || v.version < *cursor; };
  const std::span page(std::ranges::find_if(found, is_next), found.end());
  const auto shown = page.first(std::min(limit, page.size()));
  // The former path's answer is as before.
  return page_response(request.deprecated ? "versions" : "models", shown, version_table,
                       shown.size() == page.size() ? "" : std::to_string(shown.back().version),
                       [&](JsonWriter& json) { json.field("robot_id", request.param("id")); });
}

Result<Response> get_version(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  TRY_ASSIGN(const std::int64_t version, path_id(request, "model version", "version"));
  Result<history::ModelVersion> found = services.store.model(id, version);
  if (found) return http::json_response(version_table.text(*found));
  found.error().field = "version";
  return tl::unexpected(std::move(found.error()));
}

constexpr std::int64_t max_recent_robots = 200;  // a page

struct RecentAnswer {
  std::string robot_id;
  const std::vector<ingest::RecentValue>& values;
};

auto of_each(auto get) {
  return [get](const RecentAnswer& a) { return a.values | std::views::transform(get); };
}

const auto recent_table =
    Table<RecentAnswer>()
        .value("robot_id", AT(robot_id), "robot of the values")
        .integers("utime_us", of_each(AT(utime_us)),
                  "µs since the Unix epoch by the robot's clock, ascending, about one a second; as long as "
                  "the other columns")
        .all_digits("measured_power_w", of_each(AT(measured_power_w)),
                    "W, from the battery by the sensors; null: not measured")
        .all_digits("modelled_power_w", of_each(AT(modelled_power_w)),
                    "W, from the battery by the model; null: no model")
        .all_digits("speed_m_s", of_each(AT(speed_m_s)), "m/s, forward")
        .all_digits("x_m", of_each(AT(pose[0])), "m, in the robot's map frame; null: not reported")
        .all_digits("y_m", of_each(AT(pose[1])), "m, in the robot's map frame; null: not reported")
        .all_digits("heading_rad", of_each(AT(pose[2])),
                    "rad, counterclockwise from the map's x axis; null: not reported");

Result<Response> recent(const Services& services, const Request& request) {
  TRY_ASSIGN(const auto chosen, robot_ids_of(request));
  std::set<std::string> ids(chosen.begin(), chosen.end());
  if (ids.empty())
    for (const auto& snapshot : services.fleet.all()) ids.insert(snapshot->robot_id);
  const auto [page, next] = page_of_ids(request, ids);
  const auto write = [&](JsonWriter& json, const std::string& id) {
    recent_table.write(json, {id, services.recent.of(id)});
  };
  return page_response("robots", page, write, next, [](JsonWriter& json) {
    json.field("window_s", static_cast<double>(ingest::recent_window_us) / 1e6);
  });
}

}  // namespace

Part robot_part() {
  using described::of_page;
  const Schema id = described::with_words(described::of_type("string"), id_of_robot_words);
  Part part;
  part.add(Method::get, "/v1/robots", "listRobots", Role::read,
           "The fleet: every robot that has a model or has sent telemetry, by id, with its live state",
           {"robot-list", of_page("The fleet", "robots", "the robots, by id", state_table().of_member())},
           list_robots,
           {.parameters = {limit_parameter("robots a page", max_listed_robots, max_listed_robots),
                           cursor_parameter()},
            .csv = true,
            .rounded = true});
  part.add(Method::get, "/v1/robots/{id}", "getRobot", Role::read, "A robot's model in force",
           {"robot-detail", detail_table.schema()}, get_robot, {.etag = true, .error_statuses = {404}});
  part.add(Method::post, "/v1/robot-checks", "checkRobot", Role::plan,
           "Reviews a robot file without storing it, as joulecast check does",
           {"robot-check", check_table.schema()}, check_file, {.request_schema = "robot"});
  part.add(Method::put, "/v1/robots/{id}", "putRobot", Role::admin,
           "Stores a robot's model; a changed model becomes a new version and takes effect immediately",
           {"robot-version", stored_table.schema()}, put,
           {.request_schema = "robot", .error_statuses = {409}, .run = Run::write});
  part.add(Method::del, "/v1/robots/{id}", "removeRobot", Role::admin,
           "Removes a robot's model and ends its mission; with history=purge also deletes all its stored "
           "data except the event log",
           {"robot-removal", removal_table.schema()}, remove,
           {.parameters = {{.name = "history",
                            .description = "keep or purge the robot's missions and models",
                            .choices = {"keep", "purge"}}},
            .error_statuses = {404, 409},
            .run = Run::write});
  part.add(Method::get, "/v1/robots/{id}/state", "getRobotState", Role::read,
           "A robot's live state: power, charge, mission, health of its telemetry",
           {"robot-state", state_table().schema()}, state,
           {.rounded = true, .error_statuses = {404}, .run = Run::io});
  part.add(Method::get, "/v1/robots/{id}/models", "listModels", Role::read,
           "Every version of a robot's model, newest first",
           {"model-list",
            of_page("All versions of a robot model, newest first", "models",
                    "versions of the model, newest first", version_table.of_member(), {{"robot_id", id}})},
           versions,
           {.former_path = "/v1/robots/{id}/versions",
            .parameters = {limit_parameter("versions a page", history::max_page_size, history::max_page_size),
                           cursor_parameter()},
            .etag = true,
            .error_statuses = {404}});
  part.add(Method::get, "/v1/robots/{id}/models/{version}", "getModel", Role::read,
           "A version of a robot's model", {"model", version_table.schema()}, get_version,
           {.etag = true, .error_statuses = {404}});
  return part;
}

Part recent_value_part() {
  const Schema window = described::with_words(described::of_type("number"), "s, greatest age of the values");
  Part part;
  part.add(Method::get, "/v1/recent-values", "listRecentValues", Role::read,
           "The last 90 s of robots' live values in columns, one a second, for charts that begin filled; "
           "kept in memory since the daemon's start",
           {"recent-values", described::of_page("The last live values of robots, in columns", "robots",
                                                "by id", recent_table.of_member(), {{"window_s", window}})},
           recent,
           {.parameters = {{.name = "robot_id",
                            .description = "only this robot, or these, separated by commas; a robot that was "
                                           "not heard has empty columns"},
                           limit_parameter("robots a page", max_recent_robots, max_recent_robots),
                           cursor_parameter()},
            .rounded = true});
  return part;
}

}  // namespace joulecast::api
