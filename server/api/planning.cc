#include <any>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "answers/json/autonomy_json.h"
#include "answers/json/estimate_json.h"
#include "answers/json/matrix_json.h"
#include "answers/json/profile_json.h"
#include "base/try.h"
#include "ingest/model_loading.h"
#include "server/api/fleet_autonomy.h"
#include "server/api/live_robot.h"
#include "server/api/services.h"

// The endpoints for schedulers: a request is converted to an input of src/answers, its output to JSON.
namespace joulecast::api {
namespace {

using http::Request;
using http::Response;
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
  const ReadProfile read = read_profile(services, r);
  if (!read) return tl::unexpected(read.error());
  const auto& [model, input] = **read;
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

std::vector<TableRow> planning_rows() {
  using http::Method;
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::post,
        .path = "/v1/robots/{id}/profile",
        .operation_id = "computeProfile",
        .role = http::Role::plan,
        .summary =
            "The minimum-energy motion along a path, with its certificate, against trapezoid and triangle",
        .parameters = {{.name = "model_version",
                        .type = http::Parameter::Type::integer,
                        .description =
                            "the version of the robot's model to plan with; default: the one in force",
                        .minimum = 1}},
        .request_schema = "profile-request",
        .response_schema = "profile",
        .rounded = true,
        .error_statuses = {404, 422},
        .run = http::Run::compute},
       [](Services& services, http::Endpoint& endpoint) {
         answered_by(profile)(services, endpoint);
         endpoint.brief = [&services](Request& r) { return brief_profile(services, r); };
       }});
  rows.push_back(
      {{.method = Method::post,
        .path = "/v1/robots/{id}/estimate",
        .operation_id = "estimateEnergy",
        .role = http::Role::plan,
        .summary = "Energy of a path driven by its minimum-energy motion (the default; independent of the "
                   "robot's history) or its usual driving, or of a given motion",
        .request_schema = "estimate-request",
        .response_schema = "estimate",
        .rounded = true,
        .error_statuses = {404, 422},
        .run = http::Run::compute},
       answered_by(estimate)});
  rows.push_back(
      {{.method = Method::post,
        .path = "/v1/energy-matrix",
        .operation_id = "computeEnergyMatrix",
        .role = http::Role::plan,
        .summary =
            "Energy and duration of every task with every robot, one row per robot, for minimum-energy "
            "motions (the default; equal for equal robots, independent of their history) or each robot's "
            "usual driving",
        .request_schema = "energy-matrix-request",
        .response_schema = "energy-matrix",
        .error_statuses = {413, 422},
        .run = http::Run::compute},
       answered_by(matrix)});
  rows.push_back(
      {{.method = Method::post,
        .path = "/v1/robots/{id}/autonomy",
        .operation_id = "computeAutonomy",
        .role = http::Role::plan,
        .summary =
            "How far and how long a robot still goes, and whether it can do a list of tasks, driven as "
            "it usually drives (the default: the charge must last for that) or by minimum-energy motions",
        .request_schema = "autonomy-request",
        .response_schema = "autonomy",
        .rounded = true,
        .error_statuses = {404, 422},
        .run = http::Run::compute},
       answered_by(autonomy)});
  rows.push_back({{.method = Method::post,
                   .path = "/v1/autonomy",
                   .operation_id = "computeFleetAutonomy",
                   .role = http::Role::plan,
                   .summary = "The autonomy of many robots in one call",
                   .request_schema = "fleet-autonomy-request",
                   .response_schema = "fleet-autonomy",
                   .rounded = true,
                   .error_statuses = {422},
                   .run = http::Run::compute},
                  answered_by([](Services& services, const Request& r) {
                    return fleet_autonomy_answer(*r.json, services, r.stop);
                  })});
  return rows;
}

}  // namespace joulecast::api
