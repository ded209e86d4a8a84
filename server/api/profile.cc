#include "server/api/profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "energy/motion_estimate.h"
#include "planning/baseline.h"
#include "planning/gauss.h"
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
      .field("time_multiplier_w", c.time_multiplier_w)
      .field("shortest_time_s", c.shortest_time_s);
  json.key("binding").begin_array();
  for (const planning::Bound bound : c.binding) json.value(planning::name_of(bound));
  json.end_array().field("iterations", c.iterations).end_object();
}

void write_columns(JsonWriter& json, const planning::Profile& p) {
  json.key("profile").begin_object();
  // Accelerations follow from these: their spans may last some tens of microseconds.
  constexpr int nano = 9;
  json.column("time_s", p.time_s, nano).column("distance_m", p.distance_m);
  json.column("x_m", p.x_m, 4).column("y_m", p.y_m, 4).column("heading_rad", p.heading_rad, 5);
  json.column("speed_m_s", p.speed_m_s, nano).column("yaw_rate_rad_s", p.yaw_rate_rad_s, nano);
  json.column("acceleration_m_s2", p.acceleration_m_s2)
      .column("yaw_acceleration_rad_s2", p.yaw_acceleration_rad_s2);
  json.column("payload_kg", p.payload_kg, 3)
      .column("power_w", p.power_w, 4)
      .column("energy_j", p.energy_j, 4);
  json.end_object();
}

Result<void> write_baselines(JsonWriter& json, const planning::Planner& planner, const DriveRequest& request,
                             const planning::Plan& plan, bool columns) {
  json.key("baselines").begin_object();
  for (const auto& [name, ramp_fraction] : {std::pair{"trapezoid", 1.0 / 3}, std::pair{"triangle", 0.5}}) {
    json.key(name);
    const auto baseline = planning::ramp_baseline(planner.loads(), request.path, plan.run_duration_s,
                                                  request.problem.start_speed_m_s,
                                                  request.problem.end_speed_m_s, ramp_fraction, columns);
    if (!baseline) {
      json.null();
      continue;
    }
    json.begin_object().field("energy_j", baseline->energy_j).field("duration_s", baseline->duration_s);
    json.field("peak_speed_m_s", baseline->peak_speed_m_s);
    json.field("within_limits", baseline->beyond(request.problem.limits).empty());
    json.field("saving_fraction", 1 - plan.summary.energy_j / baseline->energy_j);
    if (columns) {
      json.key("profile").begin_object();
      json.column("time_s", baseline->time_s).column("speed_m_s", baseline->speed_m_s);
      json.column("yaw_rate_rad_s", baseline->yaw_rate_rad_s).column("power_w", baseline->power_w, 4);
      json.column("energy_j", baseline->energy_column_j, 4).end_object();
    }
    json.end_object();
  }
  json.end_object();
  return {};
}

// A given motion as columns: power at its points and in between, energy by Gauss's rule over each span. What
// it reaches goes into `peaks`.
planning::Profile series_of(const dynamics::DriveModel& drive, const std::vector<energy::MotionPoint>& points,
                            double payload_kg, const std::optional<energy::StartPose>& start,
                            planning::Peaks& peaks) {
  constexpr int cuts = 4;  // of a span, so that power's bow shows
  planning::Profile p;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  planning::Pose pose =
      start ? planning::Pose{start->x_m, start->y_m, start->heading_rad} : planning::Pose{nan, nan, nan};
  double distance = 0, energy = 0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const energy::MotionPoint &a = points[k], &b = points[k + 1];
    const double span = b.time_s - a.time_s;
    const double slope = (b.speed_m_s - a.speed_m_s) / span,
                 bend = (b.yaw_rate_rad_s - a.yaw_rate_rad_s) / span;
    const std::array<double, 2> climb = *energy::climb_of_span(a, b);  // estimate_motion() accepted it
    const bool in_place = a.speed_m_s == 0 && b.speed_m_s == 0;
    planning::Peaks here;
    here.peak_speed_m_s = std::max(std::fabs(a.speed_m_s), std::fabs(b.speed_m_s));
    here.peak_yaw_rate_rad_s = std::max(std::fabs(a.yaw_rate_rad_s), std::fabs(b.yaw_rate_rad_s));
    here.peak_acceleration_m_s2 = std::fabs(in_place ? drive.parameters().half_track_m * bend : slope);
    peaks.reach(here);
    const auto power = [&](double t) {
      dynamics::Instant at;
      at.wheel_speed_rad_s =
          dynamics::wheels_of_body(drive.parameters(), a.speed_m_s + slope * t, a.yaw_rate_rad_s + bend * t);
      at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(drive.parameters(), slope, bend);
      at.payload_kg = payload_kg;
      at.x_m = pose.x_m, at.y_m = pose.y_m, at.heading_rad = pose.heading_rad;
      at.climb_rad = climb[0] + (climb[1] - climb[0]) * t / span;
      const auto flow = drive.flow(at);
      peaks.reach(at.wheel_speed_rad_s, flow);
      return flow.battery_power_w;
    };
    for (int cut = 0; cut <= cuts; ++cut) {
      const double t = span * cut / cuts, h = span / cuts;
      const double v = a.speed_m_s + slope * t, yaw = a.yaw_rate_rad_s + bend * t;
      p.time_s.push_back(a.time_s + t);
      p.distance_m.push_back(distance);
      p.x_m.push_back(pose.x_m), p.y_m.push_back(pose.y_m), p.heading_rad.push_back(pose.heading_rad);
      p.speed_m_s.push_back(v), p.yaw_rate_rad_s.push_back(yaw);
      p.acceleration_m_s2.push_back(slope), p.yaw_acceleration_rad_s2.push_back(bend);
      p.payload_kg.push_back(payload_kg);
      p.power_w.push_back(power(t));
      p.energy_j.push_back(energy);
      if (cut == cuts) break;
      for (const auto& [node, weight] : planning::gauss3) energy += weight * h * power(t + node * h);
      const double way = (v + 0.5 * slope * h) * h, turned = (yaw + 0.5 * bend * h) * h;
      const double heading = pose.heading_rad + 0.5 * turned;
      pose.x_m += way * std::cos(heading), pose.y_m += way * std::sin(heading);
      pose.heading_rad += turned;
      distance += std::fabs(way);
    }
  }
  return p;
}

struct Question {
  DriveRequest drive;
  bool columns = true;
  bool baseline_columns = false;
  std::int64_t pareto_points = 0;
};

Result<Question> read_question(const nlohmann::json& body, const server::ModelInForce& model) {
  Fields fields(body);
  Question question;
  question.drive = read_drive(fields, model.robot);
  question.columns = fields.boolean("columns", true);
  question.baseline_columns = fields.boolean("baseline_columns", false);
  question.drive.problem.rows = question.columns;
  question.pareto_points = fields.integer("pareto_points", 0, max_pareto_points, 0);
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  return question;
}

Result<std::string> write_answer(const server::ModelInForce& model, const planning::Planner& planner,
                                 const Question& question, const planning::Plan& plan) {
  const DriveRequest& request = question.drive;
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  write_summary(json, plan.summary);
  write_certificate(json, plan.certificate);
  json.key("ledger_j").begin_object();
  for (std::size_t k = 0; k < energy::term_count; ++k)
    json.field(energy::term_names[k], plan.ledger.value[k]);
  json.end_object();
  if (Result<void> done = write_baselines(json, planner, request, plan, question.baseline_columns); !done)
    return tl::unexpected(std::move(done.error()));
  json.key("needed_speed_m_s");
  if (request.problem.deadline_s) {
    const auto speed = planner.needed_speed(request.path, request.problem);
    if (!speed) return tl::unexpected(speed.error());
    json.value(*speed);
  } else {
    json.null();
  }
  json.key("pareto").begin_array();
  if (question.pareto_points >= 2) {
    const auto front =
        planner.pareto(request.path, request.problem, static_cast<std::size_t>(question.pareto_points));
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
  if (question.columns) write_columns(json, plan.profile);
  json.end_object();
  return json.take();
}

}  // namespace

Result<std::string> profile_answer(const nlohmann::json& body, const server::ModelInForce& model) {
  const Result<Question> asked = read_question(body, model);
  if (!asked) return tl::unexpected(asked.error());
  const DriveRequest& request = asked->drive;
  std::optional<planning::Planner> own;
  if (request.problem.regeneration) {
    Result<planning::Planner> made = planning::Planner::make(model.robot, request.problem.regeneration);
    if (!made) return tl::unexpected(std::move(made.error()));
    own = std::move(*made);
  }
  const planning::Planner& planner = own ? *own : model.planner;
  const Result<planning::Plan> plan = planner.plan(request.path, request.problem);
  if (!plan) return tl::unexpected(plan.error());
  return write_answer(model, planner, *asked, *plan);
}

std::optional<std::string> brief_profile_answer(const nlohmann::json& body,
                                                const server::ModelInForce& model) {
  const Result<Question> asked = read_question(body, model);
  if (!asked || asked->pareto_points > 0 || asked->drive.problem.regeneration) return std::nullopt;
  const auto plan = model.planner.plan_at_once(asked->drive.path, asked->drive.problem);
  if (!plan) return std::nullopt;
  Result<std::string> text = write_answer(model, model.planner, *asked, *plan);
  if (!text) return std::nullopt;
  return std::move(*text);
}

Result<std::string> estimate_answer(const nlohmann::json& body, const server::ModelInForce& model) {
  Fields fields(body);
  energy::Accounts accounts;
  const bool columns = fields.boolean("columns", false);
  planning::Profile series;
  planning::Peaks peaks;  // stays at nothing for a plan, which keeps its limits
  if (const nlohmann::json* given = fields.member("profile")) {
    Fields profile(*given, fields.pointer("profile"));
    constexpr Bounds time{.minimum = 0, .maximum = 1e7}, speed{.minimum = -100, .maximum = 100};
    const std::vector<double> t = profile.numbers("time_s", 2, max_profile_points, time);
    const std::vector<double> v = profile.numbers("speed_m_s", 2, max_profile_points, speed);
    std::vector<double> yaw(t.size(), 0);
    if (profile.has("yaw_rate_rad_s")) yaw = profile.numbers("yaw_rate_rad_s", 2, max_profile_points, speed);
    if (profile.ok() && (v.size() != t.size() || yaw.size() != t.size()))
      profile.fault("speed_m_s", "must have as many entries as time_s");
    const auto column_of = [&](std::string_view name, const Bounds& bounds) {
      std::vector<double> unknown(t.size(), dynamics::unknown);
      return profile.has(name) ? profile.numbers(name, 2, max_profile_points, bounds) : unknown;
    };
    const std::vector<double> climb = column_of("climb_rad", {.minimum = -0.785, .maximum = 0.785});
    const std::vector<double> height = column_of("height_m", {.minimum = -1e5, .maximum = 1e5});
    if (profile.has("climb_rad") && profile.has("height_m"))
      profile.fault("climb_rad", "must not be given beside height_m, from which it follows");
    for (const auto& [name, column] : {std::pair{"climb_rad", &climb}, {"height_m", &height}})
      if (profile.ok() && column->size() != t.size())
        profile.fault(name, "must have as many entries as time_s");
    if (Result<void> done = profile.finish(); !done) fields.fault(std::move(done.error()));
    const double payload =
        fields.number("payload_kg", {.minimum = 0, .maximum = model.robot.limits.payload_kg}, 0);
    std::optional<energy::StartPose> start;
    if (const auto pose = read_start_pose(fields)) start = {pose->x_m, pose->y_m, pose->heading_rad};
    if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
    std::vector<energy::MotionPoint> points(t.size());
    for (std::size_t k = 0; k < t.size(); ++k) points[k] = {t[k], v[k], yaw[k], climb[k], height[k]};
    Result<energy::Accounts> priced = energy::estimate_motion(model.drive, points, payload, start);
    if (!priced) return tl::unexpected(std::move(priced.error()));
    accounts = *priced;
    series = series_of(model.drive, points, payload, start, peaks);
  } else {
    DriveRequest request = read_drive(fields, model.robot);
    if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
    request.problem.rows = columns;
    Result<planning::Plan> plan = planning::plan(model.robot, request.path, request.problem);
    if (!plan) return tl::unexpected(std::move(plan.error()));
    accounts.battery_j = accounts.modelled_j = plan->summary.energy_j;
    accounts.ledger = plan->ledger;
    accounts.duration_s = plan->summary.duration_s;
    accounts.distance_m = plan->summary.distance_m;
    accounts.turned_rad = plan->summary.turned_rad;
    if (columns) series = std::move(plan->profile);
  }
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  json.field("energy_j", accounts.battery_j).field("duration_s", accounts.duration_s);
  json.field("distance_m", accounts.distance_m).field("turned_rad", accounts.turned_rad);
  json.key("beyond_limits").begin_array();
  for (const planning::BrokenLimit& broken : peaks.beyond(planning::limits_of(model.robot))) {
    json.begin_object().field("limit", broken.limit);
    json.field("reached", broken.reached).field("allowed", broken.allowed).end_object();
  }
  json.end_array();
  json.key("ledger");
  write_ledger(json, accounts);
  if (columns) write_columns(json, series);
  json.end_object();
  return json.take();
}

std::vector<TableRow> planning_rows() {
  const auto with_model = [](Result<std::string> (*answer)(const nlohmann::json&,
                                                           const server::ModelInForce&)) {
    return answered_by([answer](const Services& services, const http::Request& r) -> Result<http::Response> {
      const auto model = model_of(services, r.param("id"));
      if (!model) return tl::unexpected(model.error());
      Result<std::string> text = answer(*r.json, **model);
      if (!text) return tl::unexpected(std::move(text.error()));
      return http::json_response(std::move(*text));
    });
  };
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = http::Method::post,
        .path = "/v1/robots/{id}/profile",
        .operation_id = "computeProfile",
        .summary =
            "The minimum-energy motion along a path, with its certificate, against trapezoid and triangle",
        .request_schema = "profile-request",
        .response_schema = "profile",
        .error_statuses = {404, 422}},
       [with_model](Services& services, http::Endpoint& endpoint) {
         with_model(profile_answer)(services, endpoint);
         endpoint.brief = [&services](const http::Request& r) -> std::optional<http::Response> {
           const auto model = services.models.find(r.param("id"));
           if (!model) return std::nullopt;
           std::optional<std::string> text = brief_profile_answer(*r.json, *model);
           if (!text) return std::nullopt;
           return http::json_response(std::move(*text));
         };
       }});
  rows.push_back({{.method = http::Method::post,
                   .path = "/v1/robots/{id}/estimate",
                   .operation_id = "estimateEnergy",
                   .summary = "Energy and ledger of a given motion, or of the best one along a path",
                   .request_schema = "estimate-request",
                   .response_schema = "estimate",
                   .error_statuses = {404, 422}},
                  with_model(estimate_answer)});
  return rows;
}

}  // namespace joulecast::api
