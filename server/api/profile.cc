#include "server/api/profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "planning/line.h"
#include "planning/ramp.h"
#include "server/api/fields.h"
#include "server/api/json_writer.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

constexpr int max_samples = 2001;

// The drive model's power along a straight line: exact where torque is affine in speed; a torque that is not
// (drag, Stribeck) is taken by its chord between half and full speed.
dynamics::QuadraticPower straight_power_of(const server::ModelInForce& model, double payload_kg) {
  const dynamics::Parameters<double>& p = model.drive.parameters();
  const double top = model.robot.limits.speed_m_s;
  dynamics::Instant at;
  at.payload_kg = payload_kg;
  const auto torque = [&](double speed, double acceleration) {
    at.wheel_speed_rad_s = dynamics::wheels_of_body(p, speed, 0);
    at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(p, acceleration, 0);
    return model.drive.balance(at).total_nm;
  };
  const auto half = torque(top / 2, 0), full = torque(top, 0), pushed = torque(top / 2, 1);
  dynamics::QuadraticPower power;
  for (std::size_t s : {0u, 1u}) {
    const double wheel_per_metre = dynamics::wheels_of_body(p, 1, 0)[s];
    const double damping = (full[s] - half[s]) / (top / 2);  // N m s/m
    power += dynamics::wheel_power(
                 model.drive.resistance(s, at) / (p.torque_constant_nm_a * p.torque_constant_nm_a),
                 p.voltage_constant_v_s_rad / p.torque_constant_nm_a, (pushed[s] - half[s]) / wheel_per_metre,
                 damping / wheel_per_metre, half[s] - damping * top / 2)
                 .rescaled(1 / wheel_per_metre);
  }
  power.c0 += p.idle_power_w + p.accessory_power_w;
  return power;
}

bool within(const planning::LineProfile& profile, const robot::Limits& limits) {
  constexpr double rounding = 1 + 1e-9;
  return profile.peak_speed() <= limits.speed_m_s * rounding &&
         profile.peak_acceleration() <= limits.acceleration_m_s2 * rounding &&
         profile.lowest_speed() >= -1e-9;
}

void write_samples(JsonWriter& json, const std::vector<planning::LineSample>& samples) {
  std::vector<double> column(samples.size());
  const auto write = [&](std::string_view name, double planning::LineSample::*member) {
    for (std::size_t k = 0; k < column.size(); ++k) column[k] = samples[k].*member;
    json.column(name, column);
  };
  json.key("profile").begin_object();
  write("time_s", &planning::LineSample::time_s);
  write("distance_m", &planning::LineSample::distance);
  write("speed_m_s", &planning::LineSample::speed);
  write("acceleration_m_s2", &planning::LineSample::acceleration);
  write("power_w", &planning::LineSample::power_w);
  write("energy_j", &planning::LineSample::energy_j);
  json.end_object();
}

}  // namespace

Result<ProfileRequest> parse_profile(const nlohmann::json& body, const robot::Limits& limits) {
  Fields fields(body);
  ProfileRequest request;
  static const nlohmann::json nothing = nlohmann::json::object();
  const nlohmann::json* path = fields.member("path");
  if (path == nullptr || !path->is_array() || path->size() != 1) {
    fields.fault("path", "must be an array of one segment");
  } else {
    Fields segment(path->front(), fields.pointer("path") + "/0");
    segment.choice("kind", {"straight"});
    request.length_m = segment.number("length_m", {.minimum = 1e-3, .maximum = 1e5});
    if (Result<void> done = segment.finish(); !done) fields.fault(std::move(done.error()));
  }
  request.payload_kg = fields.number("payload_kg", {.minimum = 0, .maximum = limits.payload_kg}, 0);
  request.start_speed_m_s = fields.number("start_speed_m_s", {.minimum = 0, .maximum = limits.speed_m_s}, 0);
  request.end_speed_m_s = fields.number("end_speed_m_s", {.minimum = 0, .maximum = limits.speed_m_s}, 0);
  request.duration_s = fields.optional_number("duration_s", positive);
  request.value_of_time_w = fields.number("value_of_time_w", {.minimum = 0, .maximum = 1e6}, 0);
  request.samples = static_cast<int>(fields.integer("samples", 2, max_samples, 101));
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  return request;
}

Result<std::string> profile_answer(const ProfileRequest& request, const server::ModelInForce& model) {
  const robot::Limits& limits = model.robot.limits;
  planning::LineTask task;
  task.power = straight_power_of(model, request.payload_kg);
  task.distance = request.length_m;
  task.start_speed = request.start_speed_m_s;
  task.end_speed = request.end_speed_m_s;
  task.value_of_time_w = request.value_of_time_w;

  Result<planning::LineProfile> best = request.duration_s ? planning::line_in_time(task, *request.duration_s)
                                                          : planning::line_in_free_time(task);
  if (!best) return tl::unexpected(std::move(best.error()));
  std::string method = "closed_form";
  if (!within(*best, limits)) {
    // Slower profiles of the same family have lower peaks: the fastest of them that the limits allow.
    double low = best->duration_s(), high = low;
    Result<planning::LineProfile> slow = planning::line_in_time(task, high);
    for (int k = 0; k < 60 && !(slow && within(*slow, limits)); ++k)
      slow = planning::line_in_time(task, high *= 1.25);
    if (!slow || !within(*slow, limits)) {
      return fail(Fault::infeasible, "/path/0/length_m",
                  fmt::format("is too short to change from {} to {} m/s within {} m/s^2",
                              request.start_speed_m_s, request.end_speed_m_s, limits.acceleration_m_s2));
    }
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      const auto tried = planning::line_in_time(task, middle);
      (tried && within(*tried, limits) ? high : low) = middle;
    }
    if (request.duration_s) {
      return fail(Fault::infeasible, "/duration_s",
                  fmt::format("is {} s, too short for the robot's limits; the nearest feasible is {:.3f} s",
                              *request.duration_s, high));
    }
    best = planning::line_in_time(task, high);
    if (!best) return tl::unexpected(std::move(best.error()));
    method = "closed_form_slowed_to_limits";
  }

  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version).field("method", method);
  json.field("energy_j", best->energy_j())
      .field("duration_s", best->duration_s())
      .field("distance_m", best->distance());
  json.field("peak_speed_m_s", best->peak_speed()).field("peak_acceleration_m_s2", best->peak_acceleration());
  json.field("transversality_w", best->transversality_w());
  json.key("baselines").begin_object();
  const auto baseline = [&](std::string_view name, double ramp_fraction) {
    json.key(name);
    const Result<planning::RampProfile> ramp =
        planning::ramp_in_time(task, best->duration_s(), ramp_fraction);
    if (!ramp) {
      json.null();
      return;
    }
    json.begin_object()
        .field("energy_j", ramp->energy_j())
        .field("duration_s", ramp->duration_s())
        .field("peak_speed_m_s", ramp->peak_speed());
    json.field("saving_fraction", 1 - best->energy_j() / ramp->energy_j()).end_object();
  };
  baseline("trapezoid", 1.0 / 3);
  baseline("triangle", 0.5);
  json.end_object();
  write_samples(json, best->sample(static_cast<std::size_t>(request.samples)));
  json.end_object();
  return json.take();
}

std::vector<http::Endpoint> planning_endpoints(Services& services) {
  std::vector<http::Endpoint> rows;
  rows.push_back({.method = http::Method::post,
                  .path = "/v1/robots/{id}/profile",
                  .operation_id = "computeProfile",
                  .summary = "The minimum-energy velocity profile for a path, against trapezoid and triangle",
                  .request_schema = "profile-request",
                  .response_schema = "profile",
                  .error_statuses = {404, 422},
                  .run = http::Run::io,
                  .handler = [&services](const http::Request& r) -> Result<http::Response> {
                    const auto model = model_of(services, r.param("id"));
                    if (!model) return tl::unexpected(model.error());
                    const Result<ProfileRequest> request = parse_profile(*r.json, (*model)->robot.limits);
                    if (!request) return tl::unexpected(request.error());
                    Result<std::string> answer = profile_answer(*request, **model);
                    if (!answer) return tl::unexpected(std::move(answer.error()));
                    return http::json_response(std::move(*answer));
                  }});
  return rows;
}

}  // namespace joulecast::api
