#include "server/api/profile.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "energy/motion_estimate.h"
#include "planning/baseline.h"
#include "planning/planner.h"
#include "server/api/fields.h"
#include "server/api/json_writer.h"
#include "server/api/mission_json.h"
#include "server/api/path_request.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

constexpr std::int64_t max_pareto_points = 200;
constexpr std::size_t max_profile_points = 200'000;

void write_summary(JsonWriter& json, const planning::Summary& s) {
  json.field("energy_j", s.energy_j)
      .field("duration_s", s.duration_s)
      .field("distance_m", s.distance_m)
      .field("turned_rad", s.turned_rad);
  json.field("peak_speed_m_s", s.peak_speed_m_s)
      .field("peak_yaw_rate_rad_s", s.peak_yaw_rate_rad_s)
      .field("peak_power_w", s.peak_power_w);
  json.field("braking_j", s.braking_j).field("recovered_j", s.recovered_j);
}

void write_certificate(JsonWriter& json, const planning::Certificate& c) {
  json.key("certificate").begin_object();
  json.field("method", planning::name_of(c.method))
      .field("gap_j", c.gap_j)
      .field("discretisation_j", c.discretisation_j);
  json.field("residual", c.residual)
      .field("convex", c.convex)
      .field("time_multiplier_w", c.time_multiplier_w);
  json.key("binding").begin_array();
  for (const planning::Bound bound : c.binding) json.value(planning::name_of(bound));
  json.end_array().field("iterations", c.iterations).end_object();
}

void write_columns(JsonWriter& json, const planning::Profile& p) {
  json.key("profile").begin_object();
  json.column("time_s", p.time_s).column("distance_m", p.distance_m);
  json.column("x_m", p.x_m, 4).column("y_m", p.y_m, 4).column("heading_rad", p.heading_rad, 5);
  json.column("speed_m_s", p.speed_m_s).column("yaw_rate_rad_s", p.yaw_rate_rad_s);
  json.column("acceleration_m_s2", p.acceleration_m_s2)
      .column("yaw_acceleration_rad_s2", p.yaw_acceleration_rad_s2);
  json.column("payload_kg", p.payload_kg, 3)
      .column("power_w", p.power_w, 4)
      .column("energy_j", p.energy_j, 4);
  json.end_object();
}

// How long the best plan takes on each run between stops: what the baselines are given too. One run needs no
// second solve; several are joined by the multiplier of time, which priced alone gives each run's share.
Result<std::vector<double>> run_durations(const planning::Planner& planner, const DriveRequest& request,
                                          const planning::Plan& plan) {
  const auto& runs = request.path.runs;
  if (runs.size() == 1) return std::vector<double>{plan.summary.duration_s - request.path.dwell_s()};
  std::vector<double> durations;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    planning::Path alone;
    alone.runs = {runs[k]};
    alone.runs[0].dwell_before_s = 0;
    planning::Problem problem = request.problem;
    problem.deadline_s.reset();
    problem.value_of_time_w = plan.certificate.time_multiplier_w;
    if (k > 0) problem.start_speed_m_s = 0;
    if (k + 1 < runs.size()) problem.end_speed_m_s = 0;
    const auto cost = planner.cost(alone, problem);
    if (!cost) return tl::unexpected(cost.error());
    durations.push_back(cost->duration_s);
  }
  return durations;
}

// The robot's drive, with the share of braking power that the request says returns.
Result<dynamics::DriveModel> drive_of(const server::ModelInForce& model,
                                      const std::optional<double>& regeneration) {
  if (!regeneration) return model.drive;
  robot::RobotModel robot = model.robot;
  std::erase_if(robot.effects, [](const robot::AdoptedEffect& e) { return e.id == "no_regeneration"; });
  robot.effects.push_back({"no_regeneration", {{"fraction", 1 - *regeneration}}});
  return dynamics::drive_model(robot);
}

Result<void> write_baselines(JsonWriter& json, const planning::Planner& planner,
                             const server::ModelInForce& model, const DriveRequest& request,
                             const planning::Plan& plan) {
  json.key("baselines").begin_object();
  const Result<std::vector<double>> durations = run_durations(planner, request, plan);
  if (!durations) return tl::unexpected(durations.error());
  const Result<dynamics::DriveModel> drive = drive_of(model, request.problem.regeneration);
  if (!drive) return tl::unexpected(drive.error());
  for (const auto& [name, ramp_fraction] : {std::pair{"trapezoid", 1.0 / 3}, std::pair{"triangle", 0.5}}) {
    json.key(name);
    const auto baseline =
        planning::ramp_baseline(*drive, request.path, *durations, request.problem.start_speed_m_s,
                                request.problem.end_speed_m_s, ramp_fraction);
    if (!baseline) {
      json.null();
      continue;
    }
    json.begin_object().field("energy_j", baseline->energy_j).field("duration_s", baseline->duration_s);
    json.field("peak_speed_m_s", baseline->peak_speed_m_s);
    json.field("within_limits", baseline->keeps(request.problem.limits));
    json.field("saving_fraction", 1 - plan.summary.energy_j / baseline->energy_j).end_object();
  }
  json.end_object();
  return {};
}

}  // namespace

Result<std::string> profile_answer(const nlohmann::json& body, const server::ModelInForce& model) {
  Fields fields(body);
  const DriveRequest request = read_drive(fields, model.robot);
  const bool columns = fields.boolean("columns", true);
  const std::int64_t pareto_points = fields.integer("pareto_points", 0, max_pareto_points, 0);
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));

  Result<planning::Planner> planner = planning::Planner::make(model.robot, request.problem.regeneration);
  if (!planner) return tl::unexpected(std::move(planner.error()));
  Result<planning::Plan> plan = planner->plan(request.path, request.problem);
  if (!plan) return tl::unexpected(std::move(plan.error()));

  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  write_summary(json, plan->summary);
  write_certificate(json, plan->certificate);
  json.key("ledger_j").begin_object();
  for (std::size_t k = 0; k < energy::term_count; ++k)
    json.field(energy::term_names[k], plan->ledger.value[k]);
  json.end_object();
  if (Result<void> done = write_baselines(json, *planner, model, request, *plan); !done)
    return tl::unexpected(std::move(done.error()));
  json.key("needed_speed_m_s");
  if (request.problem.deadline_s) {
    const auto speed = planner->needed_speed(request.path, request.problem);
    if (!speed) return tl::unexpected(speed.error());
    json.value(*speed);
  } else {
    json.null();
  }
  json.key("pareto").begin_array();
  if (pareto_points >= 2) {
    const auto front =
        planner->pareto(request.path, request.problem, static_cast<std::size_t>(pareto_points));
    if (!front) return tl::unexpected(front.error());
    for (const planning::PlanCost& cost : *front) {
      json.begin_object()
          .field("duration_s", cost.duration_s)
          .field("energy_j", cost.energy_j)
          .field("time_multiplier_w", cost.time_multiplier_w)
          .field("peak_speed_m_s", cost.peak_speed_m_s)
          .end_object();
    }
  }
  json.end_array();
  if (columns) write_columns(json, plan->profile);
  json.end_object();
  return json.take();
}

Result<std::string> estimate_answer(const nlohmann::json& body, const server::ModelInForce& model) {
  Fields fields(body);
  energy::Accounts accounts;
  if (const nlohmann::json* given = fields.member("profile")) {
    Fields profile(*given, fields.pointer("profile"));
    constexpr Bounds time{.minimum = 0, .maximum = 1e7}, speed{.minimum = -100, .maximum = 100};
    const std::vector<double> t = profile.numbers("time_s", 2, max_profile_points, time);
    const std::vector<double> v = profile.numbers("speed_m_s", 2, max_profile_points, speed);
    std::vector<double> yaw(t.size(), 0);
    if (profile.has("yaw_rate_rad_s")) yaw = profile.numbers("yaw_rate_rad_s", 2, max_profile_points, speed);
    if (profile.ok() && (v.size() != t.size() || yaw.size() != t.size()))
      profile.fault("speed_m_s", "must have as many entries as time_s");
    if (Result<void> done = profile.finish(); !done) fields.fault(std::move(done.error()));
    const double payload =
        fields.number("payload_kg", {.minimum = 0, .maximum = model.robot.limits.payload_kg}, 0);
    std::optional<energy::StartPose> start;
    if (const nlohmann::json* at = fields.member("start_pose")) {
      Fields pose(*at, fields.pointer("start_pose"));
      constexpr Bounds place{.minimum = -1e6, .maximum = 1e6};
      start = energy::StartPose{pose.number("x_m", place), pose.number("y_m", place),
                                pose.number("heading_rad", place)};
      if (Result<void> done = pose.finish(); !done) fields.fault(std::move(done.error()));
    }
    if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
    std::vector<energy::MotionPoint> points(t.size());
    for (std::size_t k = 0; k < t.size(); ++k) points[k] = {t[k], v[k], yaw[k]};
    Result<energy::Accounts> priced = energy::estimate_motion(model.drive, points, payload, start);
    if (!priced) return tl::unexpected(std::move(priced.error()));
    accounts = *priced;
  } else {
    const DriveRequest request = read_drive(fields, model.robot);
    if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
    Result<planning::Plan> plan = planning::plan(model.robot, request.path, request.problem);
    if (!plan) return tl::unexpected(std::move(plan.error()));
    accounts.battery_j = accounts.modelled_j = plan->summary.energy_j;
    accounts.ledger = plan->ledger;
    accounts.duration_s = plan->summary.duration_s;
    accounts.distance_m = plan->summary.distance_m;
    accounts.turned_rad = plan->summary.turned_rad;
  }
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  json.field("energy_j", accounts.battery_j).field("duration_s", accounts.duration_s);
  json.field("distance_m", accounts.distance_m).field("turned_rad", accounts.turned_rad);
  json.key("ledger");
  write_ledger(json, accounts);
  json.end_object();
  return json.take();
}

std::vector<http::Endpoint> planning_endpoints(Services& services) {
  const auto with_model =
      [&services](Result<std::string> (*answer)(const nlohmann::json&, const server::ModelInForce&)) {
        return [&services, answer](const http::Request& r) -> Result<http::Response> {
          const auto model = model_of(services, r.param("id"));
          if (!model) return tl::unexpected(model.error());
          Result<std::string> text = answer(*r.json, **model);
          if (!text) return tl::unexpected(std::move(text.error()));
          return http::json_response(std::move(*text));
        };
      };
  std::vector<http::Endpoint> rows;
  rows.push_back(
      {.method = http::Method::post,
       .path = "/v1/robots/{id}/profile",
       .operation_id = "computeProfile",
       .summary =
           "The minimum-energy motion along a path, with its certificate, against trapezoid and triangle",
       .request_schema = "profile-request",
       .response_schema = "profile",
       .error_statuses = {404, 422},
       .handler = with_model(profile_answer)});
  rows.push_back({.method = http::Method::post,
                  .path = "/v1/robots/{id}/estimate",
                  .operation_id = "estimateEnergy",
                  .summary = "Energy and ledger of a given motion, or of the best one along a path",
                  .request_schema = "estimate-request",
                  .response_schema = "estimate",
                  .error_statuses = {404, 422},
                  .handler = with_model(estimate_answer)});
  return rows;
}

}  // namespace joulecast::api
