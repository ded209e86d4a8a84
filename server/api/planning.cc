#include <algorithm>
#include <any>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "answers/autonomy.h"
#include "answers/estimate.h"
#include "answers/matrix.h"
#include "answers/profile.h"
#include "base/parallel.h"
#include "base/try.h"
#include "describe/input.h"
#include "ingest/model_registry.h"
#include "server/api/common_parameters.h"
#include "server/api/robot_json.h"
#include "server/api/services.h"

// The endpoints for schedulers: a request is converted to an input of src/answers, its output to JSON.
namespace joulecast::api {
namespace {

using Json = nlohmann::json;

std::string_view name_of(Fault fault) {
  if (fault == Fault::invalid) return "invalid";
  if (fault == Fault::not_found) return "not_found";
  return fault == Fault::infeasible ? "infeasible" : "internal";
}

struct Row {
  std::string robot_id;
  std::string at = "/request";  // JSON pointer of its request
  // This robot's request, which replaces the common one, or the error in it.
  std::optional<Result<answers::AutonomyRequest>> own = {};
};

struct ProblemRow {
  std::string robot_id;
  const Error& error;
};

// A battery message of another standard.
struct BatteryRow {
  std::string robot_id;
  std::string message;
};

constexpr const char* id_words = "the robot's id, as in its telemetry and its file";

const auto error_table =
    Table<Error>()
        .word(
            "fault", [](const Error& e) { return name_of(e.fault); },
            std::array{"invalid", "not_found", "infeasible", "internal"}, "kind of the problem")
        .value("field", AT(field), "field of the request at fault; empty: none")
        .value("message", AT(message), "the problem in a sentence");
const auto problem_table =
    Table<ProblemRow>({}, "problem of a robot without a forecast")
        .value("robot_id", AT(robot_id), id_words)
        .object("problem", AT(error), "the reason why this robot has no forecast", error_table);

const auto battery_table =
    Table<BatteryRow>({}, "in another dialect")
        .value("robot_id", AT(robot_id), id_words)
        .json("battery", AT(message), "in the requested dialect", described::of_reference("battery-status"));

// Request for all robots without a request of their own.
struct Common {
  answers::AutonomyRequest request;
  answers::TaskPlan plan;  // for robots without position and payload
};

bool depends_on_whereabouts(const answers::AutonomyInput& input) {
  return !input.start_pose || !input.payload_kg;
}

// For errors of a request that is at that JSON pointer in the body.
auto within(std::string at) {
  return [at = std::move(at)](Error error) {
    error.field.insert(0, at);
    return error;
  };
}

Result<std::string> answer_autonomy(const Row& row, const Common& common, const Services& services,
                                    const std::stop_token& stop) {
  TRY_ASSIGN(const auto model, model_of(services, row.robot_id));
  if (row.own && !*row.own) return tl::unexpected(row.own->error());
  const answers::LiveRobot now = live_robot(services.fleet.find(row.robot_id).get());
  const answers::AutonomyRequest& request = row.own ? **row.own : common.request;
  std::optional<answers::TaskPlan> mine;
  if (row.own || (depends_on_whereabouts(request.input) && (now.pose || now.payload_kg))) {
    TRY_ASSIGN(mine, answers::task_plan(request.input, now).map_error(within(row.at)));
  }
  const answers::RobotOutlook robot = services.forecasts.of(model);
  TRY_ASSIGN(const auto autonomy, answers::autonomy(request.input, mine ? *mine : common.plan, robot, now,
                                                    services.cost_tables, stop)
                                      .map_error(within(row.at)));
  std::string text = answers::autonomy_json(request, autonomy, robot, now);
  if (request.dialect == answers::Dialect::joulecast) return text;
  return battery_table.text({row.robot_id, text});
}

const Json* request_of(Fields& fields) {
  const Json* request = fields.member("request");
  if (request != nullptr && !request->is_object()) fields.fault("request", "must be an object");
  return request;
}

struct FleetRequest {
  const Json* shared = nullptr;  // within the body
  bool whole_fleet = false;
  std::vector<Row> rows;
};

const auto row_input =
    described::Input<Row>()
        .text("robot_id", &Row::robot_id, 256, "the robot's id, as in its telemetry and its file")
        .custom("request", described::of_reference("autonomy-request"), "instead of the common request",
                [](Fields& own, Row& read, described::Nothing&) {
                  const Json* request = request_of(own);
                  if (request == nullptr) return;
                  read.at = own.pointer("request");
                  read.own = answers::read_autonomy(*request, false, read.at);
                });
const auto fleet_input =
    described::Input<FleetRequest>("Autonomy of several robots")
        .custom("request", described::of_reference("autonomy-request"),
                "request for all robots without their own",
                [](Fields& fields, FleetRequest& read, described::Nothing&) {
                  read.shared = request_of(fields);
                  read.whole_fleet = !fields.has("robots");
                })
        .list("robots", &FleetRequest::rows, {0, 10'000, "robots"}, "default: every robot that has a model",
              described::OrText(&Row::robot_id, "the robot's id; its request is the common one", row_input),
              described::Presence::optional);

described::Schemas fleet_autonomy_schemas() {
  const Schema row{
      {"anyOf",
       {described::of_reference("robot-autonomy"), battery_table.of_member(), problem_table.of_member()}}};
  const Schema rows = described::with_words(
      described::of_array(row),
      "one element per robot in the requested order; a robot without a forecast has a problem");
  return {{"fleet-autonomy-request", fleet_input.schema()},
          {"fleet-autonomy",
           described::of_object(
               "Autonomy of several robots, one row per robot in the requested order, by default by id", {},
               {{"robots", rows}})}};
}

// {"robots": [...], "request": {...}}; one row per robot in the requested order, by default by id.
Result<Response> fleet_autonomy_answer(const Json& body, Services& services, const std::stop_token& stop) {
  TRY_ASSIGN(auto read, fleet_input.read(body));
  std::vector<Row>& rows = read.rows;
  if (read.whole_fleet)
    for (const auto& model : services.models.all()) rows.push_back({model->robot.robot_id});
  // An invalid common request is an error of the whole request.
  TRY_ASSIGN(auto request, answers::read_autonomy(read.shared != nullptr ? *read.shared : Json::object(),
                                                  false, "/request"));
  TRY_ASSIGN(auto plan, answers::task_plan(request.input, {}).map_error(within("/request")));
  const Common common{std::move(request), std::move(plan)};

  std::vector<std::string> texts(rows.size());
  parallel_for(rows.size(), 2, [&](std::size_t k) {
    if (stop.stop_requested()) return;
    auto text = answer_autonomy(rows[k], common, services, stop);
    texts[k] = text ? std::move(*text) : problem_table.text({rows[k].robot_id, text.error()});
  });
  if (stop.stop_requested()) return fail(Fault::stopped, "", "the answer is no longer wanted");
  JsonWriter out;
  out.begin_object().key("robots").begin_array();
  for (const std::string& text : texts) out.raw(text);
  Response response = http::json_response(out.end_array().end_object().take());
  response.deprecated = common.request.former() || std::ranges::any_of(rows, [](const Row& row) {
                          return row.own && *row.own && (*row.own)->former();
                        });
  return response;
}

using Model = std::shared_ptr<const answers::ModelInForce>;

// The version of the robot's model that the request names, or the one in force.
Result<Model> model_of_version(const Services& services, const Request& r) {
  const std::string& id = r.param("id");
  auto in_force = model_of(services, id);
  const std::optional<std::int64_t> version = r.query_integer("model_version");
  if (!in_force || !version || *version == (*in_force)->version) return in_force;
  return ingest::stored_model(services.store, id, *version);
}

// A profile request, read once: by the first of `brief` and `handler`.
struct ProfileRequest {
  Model model;
  answers::ProfileInput input;
};
using ReadProfile = Result<std::shared_ptr<const ProfileRequest>>;

ReadProfile read_profile(const Services& services, const Request& r) {
  if (const auto* read = std::any_cast<ReadProfile>(&r.input)) return *read;
  TRY_ASSIGN(auto model, model_of_version(services, r));
  TRY_ASSIGN(auto input, answers::read_profile(*r.json, model->robot));
  return std::make_shared<const ProfileRequest>(ProfileRequest{std::move(model), std::move(input)});
}

std::optional<Response> brief_profile(const Services& services, Request& r) {
  if (r.query_value("model_version")) return std::nullopt;  // which is read from the store
  ReadProfile read = read_profile(services, r);
  if (read) {
    const auto& [model, input] = **read;
    if (const auto output = answers::profile_at_once(input, *model))
      return http::json_response(answers::profile_json(input, *output, *model));
  }
  r.input = std::move(read);
  return std::nullopt;
}

Result<Response> profile(const Services& services, const Request& r) {
  TRY_ASSIGN(const auto read, read_profile(services, r));
  const auto& [model, input] = *read;
  TRY_ASSIGN(const auto output, answers::profile(input, *model, r.stop));
  return http::json_response(answers::profile_json(input, output, *model));
}

Result<Response> estimate(const Services& services, const Request& r) {
  TRY_ASSIGN(const auto model, model_of(services, r.param("id")));
  TRY_ASSIGN(const auto input, answers::read_estimate(*r.json, model->robot));
  const bool usual = input.driving == answers::Driving::usual;
  TRY_ASSIGN(const auto output,
             answers::estimate(
                 input, usual ? services.forecasts.of(model) : answers::RobotOutlook{model, nullptr, nullptr},
                 r.stop));
  return http::json_response(answers::estimate_json(input, output, *model));
}

Result<Response> autonomy(const Services& services, const Request& r) {
  const std::string& id = r.param("id");
  TRY_ASSIGN(const auto model, model_of(services, id));
  TRY_ASSIGN(const auto request, answers::read_autonomy(*r.json, true));
  TRY_ASSIGN(auto text,
             answers::autonomy_text(request, services.forecasts.of(model),
                                    live_robot(services.fleet.find(id).get()), services.cost_tables, r.stop));
  Response response = http::json_response(std::move(text));
  response.deprecated = request.former();
  return response;
}

Result<Response> matrix(const Services& services, const Request& r) {
  TRY_ASSIGN(auto input, answers::read_matrix(*r.json));
  Response response;
  response.deprecated = input.former;
  answers::MatrixFleet fleet;
  fleet.model = [&services](const std::string& id) { return model_of(services, id); };
  fleet.live = [&services](const std::string& id) { return live_robot(services.fleet.find(id).get()); };
  fleet.outlook = [&services](const Model& model) { return services.forecasts.of(model); };
  const auto text =
      std::make_shared<answers::MatrixText>(answers::Matrix(std::move(input), fleet, services.cost_tables));
  response.stream =
      http::generate([text](std::string& out, const std::stop_token& left) { return text->next(out, left); });
  return response;
}

}  // namespace

Part planning_part() {
  Part part{.schemas = fleet_autonomy_schemas()};
  part.rows.push_back(
      {{.method = Method::post,
        .path = "/v1/robots/{id}/profile",
        .operation_id = "computeProfile",
        .role = Role::plan,
        .summary =
            "The minimum-energy motion along a path, with its certificate, against trapezoid and triangle",
        .parameters = {bounded(Parameter::Type::integer, "model_version",
                               "the version of the robot's model to plan with; default: the one in force",
                               1)},
        .request_schema = "profile-request",
        .response_schema = "profile",
        .rounded = true,
        .error_statuses = {404},
        .run = Run::compute},
       [](Services& services, http::Endpoint& endpoint) {
         answered_by(profile)(services, endpoint);
         endpoint.brief = [&services](Request& r) { return brief_profile(services, r); };
       }});
  part.add(
      Method::post, "/v1/robots/{id}/estimate", "estimateEnergy", Role::plan,
      "Energy of a path driven by its minimum-energy motion (the default; independent of the robot's "
      "history) or its usual driving, or of a given motion",
      {"estimate"}, estimate,
      {.request_schema = "estimate-request", .rounded = true, .error_statuses = {404}, .run = Run::compute});
  part.add(
      Method::post, "/v1/energy-matrix", "computeEnergyMatrix", Role::plan,
      "Energy and duration of every task with every robot, one row per robot, for minimum-energy motions "
      "(the default; equal for equal robots, independent of their history) or each robot's usual driving",
      {"energy-matrix"}, matrix, {.request_schema = "energy-matrix-request", .run = Run::compute});
  part.add(
      Method::post, "/v1/robots/{id}/autonomy", "computeAutonomy", Role::plan,
      "How far and how long a robot still goes, and whether it can do a list of tasks, driven as it "
      "usually drives (the default: the charge must last for that) or by minimum-energy motions",
      {"autonomy"}, autonomy,
      {.request_schema = "autonomy-request", .rounded = true, .error_statuses = {404}, .run = Run::compute});
  part.add(
      Method::post, "/v1/autonomy", "computeFleetAutonomy", Role::plan,
      "The autonomy of many robots in one call", {"fleet-autonomy"},
      [](Services& services, const Request& r) { return fleet_autonomy_answer(*r.json, services, r.stop); },
      {.request_schema = "fleet-autonomy-request", .rounded = true, .run = Run::compute});
  return part;
}

}  // namespace joulecast::api
