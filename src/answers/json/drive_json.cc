#include "answers/json/drive_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>
#include <vector>

namespace joulecast::answers {
namespace {

using Json = nlohmann::json;

constexpr std::size_t max_segments = 10'000;
constexpr std::size_t max_points = 100'000;
constexpr double max_length_m = 1e5;
constexpr double max_turn_rad = 100 * std::numbers::pi;
constexpr Bounds length{.minimum = 1e-6, .maximum = max_length_m};
constexpr Bounds curvature{.minimum = -1e3, .maximum = 1e3};

planning::Point read_point(Fields& fields, std::string_view name) {
  const Json* member = fields.required(name);
  if (member == nullptr) return {};
  Fields point(*member, fields.pointer(name));
  const planning::Point read{point.number("x_m", position_bounds_m), point.number("y_m", position_bounds_m)};
  if (Result<void> done = point.finish(); !done) fields.fault(std::move(done.error()));
  return read;
}

std::vector<planning::Point> read_points(Fields& fields, std::string_view name) {
  const Json* member = fields.required(name);
  if (member == nullptr) return {};
  if (!member->is_array() || member->empty() || member->size() > max_points) {
    fields.fault(name, fmt::format("must be an array of 1 to {} points", max_points));
    return {};
  }
  std::vector<planning::Point> points;
  for (std::size_t k = 0; k < member->size() && fields.ok(); ++k) {
    Fields point((*member)[k], fmt::format("{}/{}", fields.pointer(name), k));
    points.push_back({point.number("x_m", position_bounds_m), point.number("y_m", position_bounds_m)});
    if (Result<void> done = point.finish(); !done) fields.fault(std::move(done.error()));
  }
  return points;
}

planning::Segment read_segment(Fields& f, double payload_limit_kg) {
  const std::string kind = f.choice("kind", {"straight", "turn", "arc", "polyline", "bezier",
                                             "gaussian_detour", "clothoid", "curvature", "dwell", "payload"});
  if (kind == "turn")
    return planning::TurnInPlace{f.number("angle_rad", {.minimum = -max_turn_rad, .maximum = max_turn_rad})};
  if (kind == "arc")
    return planning::Arc{f.number("radius_m", length),
                         f.number("angle_rad", {.minimum = -max_turn_rad, .maximum = max_turn_rad})};
  if (kind == "polyline") return planning::Polyline{read_points(f, "points")};
  if (kind == "bezier")
    return planning::Bezier{read_point(f, "control_1"), read_point(f, "control_2"), read_point(f, "end")};
  if (kind == "gaussian_detour") {
    return planning::GaussianDetour{f.number("length_m", length), f.number("amplitude_m", position_bounds_m),
                                    f.number("centre_m", position_bounds_m), f.number("width_m", length)};
  }
  if (kind == "clothoid")
    return planning::Clothoid{f.number("length_m", length), f.number("start_curvature_1_m", curvature),
                              f.number("end_curvature_1_m", curvature)};
  if (kind == "curvature")
    return planning::SampledCurvature{f.numbers("way_m", 2, max_points, not_negative),
                                      f.numbers("curvature_1_m", 2, max_points, curvature)};
  if (kind == "dwell") return planning::Dwell{f.number("duration_s", {.minimum = 0, .maximum = 1e7})};
  if (kind == "payload")
    return planning::PayloadChange{f.number("payload_kg", {.minimum = 0, .maximum = payload_limit_kg})};
  return planning::Straight{f.number("length_m", length)};
}

void tighten(Fields& fields, planning::Limits& limits) {
  const Json* member = fields.member("limits");
  if (member == nullptr) return;
  Fields own(*member, fields.pointer("limits"));
  const auto read = [&](std::string_view name, double& limit) {
    if (const auto value = own.optional_number(name, positive)) limit = std::min(limit, *value);
  };
  read("speed_m_s", limits.speed_m_s);
  read("acceleration_m_s2", limits.acceleration_m_s2);
  read("yaw_rate_rad_s", limits.yaw_rate_rad_s);
  read("wheel_speed_rad_s", limits.wheel_speed_rad_s);
  read("current_a", limits.current_a);
  read("voltage_v", limits.voltage_v);
  limits.least_speed_m_s = own.optional_number("least_speed_m_s", positive).value_or(0);
  if (Result<void> done = own.finish(); !done) fields.fault(std::move(done.error()));
}

}  // namespace

std::optional<planning::Pose> read_start_pose(Fields& fields) {
  const Json* start = fields.member("start_pose");
  if (start == nullptr) return std::nullopt;
  Fields pose(*start, fields.pointer("start_pose"));
  const planning::Pose read{pose.number("x_m", position_bounds_m), pose.number("y_m", position_bounds_m),
                            pose.number("heading_rad", {.minimum = -1e3, .maximum = 1e3})};
  if (Result<void> done = pose.finish(); !done) fields.fault(std::move(done.error()));
  return read;
}

std::vector<planning::Segment> read_path(Fields& fields, double payload_limit_kg) {
  std::vector<planning::Segment> segments;
  const Json* path = fields.required("path");
  if (path == nullptr) return segments;
  if (!path->is_array() || path->empty() || path->size() > max_segments) {
    fields.fault("path", fmt::format("must be an array of 1 to {} segments", max_segments));
    return segments;
  }
  segments.reserve(path->size());
  for (std::size_t k = 0; k < path->size() && fields.ok(); ++k) {
    Fields segment((*path)[k], fmt::format("{}/{}", fields.pointer("path"), k));
    segments.push_back(read_segment(segment, payload_limit_kg));
    if (Result<void> done = segment.finish(); !done) fields.fault(std::move(done.error()));
  }
  return segments;
}

DriveInput read_drive(Fields& fields, const robot::RobotModel& robot) {
  DriveInput request;
  request.problem.limits = planning::limits_of(robot);
  tighten(fields, request.problem.limits);
  const double top = request.problem.limits.speed_m_s;
  request.problem.start_speed_m_s = fields.number("start_speed_m_s", {.minimum = 0, .maximum = top}, 0);
  request.problem.end_speed_m_s = fields.number("end_speed_m_s", {.minimum = 0, .maximum = top}, 0);
  request.problem.deadline_s = fields.optional_number("deadline_s", positive);
  request.problem.value_of_time_w = fields.number("value_of_time_w", {.minimum = 0, .maximum = 1e6}, 0);
  request.problem.regeneration = fields.optional_number("regeneration", fraction);

  request.options.payload_kg =
      fields.number("payload_kg", {.minimum = 0, .maximum = robot.limits.payload_kg}, 0);
  request.options.start = read_start_pose(fields).value_or(planning::Pose{});
  request.path = read_path(fields, robot.limits.payload_kg);
  return request;
}

Driving read_driving(Fields& fields, Driving fallback) {
  const std::string word =
      fields.choice("driving", {std::begin(driving_names), std::end(driving_names)}, name_of(fallback));
  return word == name_of(Driving::usual) ? Driving::usual : Driving::minimum_energy;
}

void write_profile_columns(JsonWriter& json, const planning::Profile& p) {
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

void write_quantiles(JsonWriter& json, std::string_view name, const std::array<double, 3>& values) {
  json.key(name).begin_object();
  json.field("p05", values[0]).field("p50", values[1]).field("p95", values[2]).end_object();
}

}  // namespace joulecast::answers
