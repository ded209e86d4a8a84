#include "server/api/autonomy.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/api/fields.h"
#include "server/api/json_writer.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

constexpr std::int64_t recent_missions = 20;
constexpr double usual_speed_fraction =
    0.7;  // of the speed limit, where no mission shows the robot's own habit

}  // namespace

Result<AutonomyRequest> parse_autonomy(const nlohmann::json& body) {
  Fields fields(body);
  AutonomyRequest request;
  request.state_of_charge = fields.optional_number("state_of_charge", fraction);
  request.reserve_fraction = fields.optional_number("reserve_fraction", fraction);
  request.payload_kg = fields.optional_number("payload_kg", not_negative);
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  return request;
}

Consumption consumption_of(const std::vector<history::Mission>& recent, const server::ModelInForce& model,
                           double payload_kg) {
  Consumption c{"recent_missions"};
  for (const history::Mission& mission : recent) {
    if (mission.accounts.battery_j <= 0 || mission.accounts.duration_s <= 0) continue;
    ++c.missions;
    c.energy_j += mission.accounts.battery_j;
    c.distance_m += mission.accounts.distance_m;
    c.duration_s += mission.accounts.duration_s;
  }
  if (c.missions > 0) return c;
  dynamics::Instant at;
  const double speed = usual_speed_fraction * model.robot.limits.speed_m_s;
  at.wheel_speed_rad_s = dynamics::wheels_of_body(model.drive.parameters(), speed, 0);
  at.payload_kg = payload_kg;
  return {"model", 0, model.drive.flow(at).battery_power_w, speed, 1};
}

Result<std::string> autonomy_answer(const AutonomyRequest& request, const server::ModelInForce& model,
                                    const server::RobotSnapshot* live,
                                    const std::vector<history::Mission>& recent) {
  const double charge =
      request.state_of_charge.value_or(live != nullptr ? live->state_of_charge : telemetry::unmeasured);
  if (!std::isfinite(charge)) {
    return fail(Fault::infeasible, "/state_of_charge",
                "is not known: the robot has reported no battery voltage and current since it was first "
                "seen; give it in the request");
  }
  const robot::Battery& battery = model.robot.battery;
  const double reserve = request.reserve_fraction.value_or(battery.reserve_fraction);
  const double usable_j =
      std::max(0.0, charge - reserve) * battery.capacity_ah * 3600 * battery.nominal_voltage_v;
  const double declared =
      live != nullptr && std::isfinite(live->sample.payload_kg) ? live->sample.payload_kg : 0;
  const Consumption spent = consumption_of(recent, model, request.payload_kg.value_or(declared));

  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  json.field("state_of_charge", charge).field("reserve_fraction", reserve).field("usable_energy_j", usable_j);
  json.key("consumption").begin_object();
  json.field("basis", spent.basis).field("missions", spent.missions);
  json.field("energy_j", spent.energy_j)
      .field("distance_m", spent.distance_m)
      .field("duration_s", spent.duration_s);
  const double per_metre = spent.distance_m > 0 ? spent.energy_j / spent.distance_m : telemetry::unmeasured;
  const double power = spent.energy_j / spent.duration_s;
  json.field("energy_per_m_j", per_metre).field("mean_power_w", power);
  json.end_object();
  json.field("range_m", usable_j / per_metre).field("run_time_s", usable_j / power);
  json.end_object();
  return json.take();
}

std::vector<http::Endpoint> autonomy_endpoints(Services& services) {
  std::vector<http::Endpoint> rows;
  rows.push_back({.method = http::Method::post,
                  .path = "/v1/robots/{id}/autonomy",
                  .operation_id = "computeAutonomy",
                  .summary = "How far and how long a robot still goes above its reserve",
                  .request_schema = "autonomy-request",
                  .response_schema = "autonomy",
                  .error_statuses = {404, 422},
                  .handler = [&services](const http::Request& r) -> Result<http::Response> {
                    const std::string& id = r.param("id");
                    const auto model = model_of(services, id);
                    if (!model) return tl::unexpected(model.error());
                    const Result<AutonomyRequest> request = parse_autonomy(*r.json);
                    if (!request) return tl::unexpected(request.error());
                    history::MissionFilter filter;
                    filter.robot_id = id;
                    Result<history::MissionPage> recent =
                        services.store.missions(filter, {.limit = recent_missions, .cursor = {}});
                    if (!recent) return tl::unexpected(std::move(recent.error()));
                    const auto live = services.fleet.find(id);
                    Result<std::string> answer =
                        autonomy_answer(*request, **model, live.get(), recent->missions);
                    if (!answer) return tl::unexpected(std::move(answer.error()));
                    return http::json_response(std::move(*answer));
                  }});
  return rows;
}

}  // namespace joulecast::api
