#include "server/api/autonomy_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "server/api/path_request.h"

namespace joulecast::api {
namespace {

using forecast::Motion;
using forecast::PlannedLeg;
using nlohmann::json;

constexpr std::size_t max_tasks = 1000;
constexpr Bounds place{.minimum = -1e6, .maximum = 1e6};
constexpr Bounds heading{.minimum = -1e3, .maximum = 1e3};
constexpr Bounds payload{.minimum = 0, .maximum = 1e6};
constexpr Bounds way{.minimum = 0, .maximum = 1e6};
constexpr std::array<std::string_view, 4> what_to_do{"path", "turn_rad", "distance_m", "dwell_s"};
constexpr Bounds dwell{.minimum = 0, .maximum = 1e7};

struct Charger {
  std::optional<planning::Point> at;
  double detour = 1;
};

StatedPace read_pace(Fields& fields) {
  StatedPace pace;
  pace.speed_m_s = fields.optional_number("speed_m_s", positive);
  pace.acceleration_m_s2 = fields.optional_number("acceleration_m_s2", positive);
  pace.yaw_rate_rad_s = fields.optional_number("yaw_rate_rad_s", positive);
  pace.yaw_acceleration_rad_s2 = fields.optional_number("yaw_acceleration_rad_s2", positive);
  return pace;
}

StatedPace merged(StatedPace own, const StatedPace& common) {
  const auto fill = [](std::optional<double>& value, const std::optional<double>& other) {
    if (!value) value = other;
  };
  fill(own.speed_m_s, common.speed_m_s);
  fill(own.acceleration_m_s2, common.acceleration_m_s2);
  fill(own.yaw_rate_rad_s, common.yaw_rate_rad_s);
  fill(own.yaw_acceleration_rad_s2, common.yaw_acceleration_rad_s2);
  return own;
}

std::vector<PlannedLeg> to_charger(const Charger& charger, const planning::Pose& from,
                                   const std::optional<double>& distance_m, double payload_kg) {
  std::vector<PlannedLeg> legs;
  if (distance_m) {
    if (*distance_m > 0) legs.push_back({Motion::drive, *distance_m, 0, payload_kg, 0});
  } else if (charger.at) {
    const double dx = charger.at->x_m - from.x_m, dy = charger.at->y_m - from.y_m;
    const double turn =
        std::fabs(std::remainder(std::atan2(dy, dx) - from.heading_rad, 2 * std::numbers::pi));
    const double distance = std::hypot(dx, dy);
    if (distance > 0 && turn > 0) legs.push_back({Motion::turn, turn, 0, payload_kg, 0});
    if (distance > 0) legs.push_back({Motion::drive, distance * charger.detour, 0, payload_kg, 0});
  } else {
    return legs;
  }
  // At the charger already: a charger is given, and the way there costs nothing.
  if (legs.empty()) legs.push_back({Motion::stand, 0, 0, payload_kg, 0});
  return legs;
}

// The task's stretches; `pose` and `payload_kg` go on to where it ends.
std::vector<PlannedLeg> read_legs(Fields& fields, planning::Pose& pose, double& payload_kg) {
  std::vector<PlannedLeg> legs;
  if (fields.has("path")) {
    planning::PathOptions options;
    options.start = pose;
    options.payload_kg = payload_kg;
    const std::optional<planning::Path> path = read_path(fields, options, payload.maximum);
    if (!path) return legs;
    legs = forecast::planned_legs(*path);
    payload_kg = path->final_payload_kg;
    if (!path->runs.empty()) pose = path->runs.back().knots.back().pose;
  } else {
    const double turn = fields.number("turn_rad", {.minimum = -1e3, .maximum = 1e3}, 0);
    const double distance = fields.number("distance_m", way, 0);
    if (turn != 0) legs.push_back({Motion::turn, std::fabs(turn), 0, payload_kg, 0});
    if (distance > 0) legs.push_back({Motion::drive, distance, 0, payload_kg, 0});
    pose.heading_rad += turn;
    pose.x_m += distance * std::cos(pose.heading_rad);
    pose.y_m += distance * std::sin(pose.heading_rad);
  }
  if (const double dwell_s = fields.number("dwell_s", dwell, 0); dwell_s > 0)
    legs.push_back({Motion::stand, 0, 0, payload_kg, dwell_s});
  return legs;
}

}  // namespace

AutonomyRequest read_autonomy(Fields& fields, const Whereabouts& now, bool single) {
  AutonomyRequest request;
  request.state_of_charge = fields.optional_number("state_of_charge", fraction);
  request.state_of_charge_sd = fields.optional_number("state_of_charge_sd", {.minimum = 0, .maximum = 0.5});
  request.reserve_fraction = fields.optional_number("reserve_fraction", fraction);
  request.payload_kg = fields.optional_number("payload_kg", payload);
  request.minimum_energy = fields.choice("driving", {"usual", "minimum_energy"}, "usual") == "minimum_energy";
  request.compare_minimum_energy =
      fields.boolean("compare_minimum_energy", single) && !request.minimum_energy;
  request.value_of_time_w = fields.number("value_of_time_w", {.minimum = 0, .maximum = 1e6}, 0);
  request.pace = read_pace(fields);
  request.confidence = fields.number("confidence", {.minimum = 0.01, .maximum = 0.999}, 0.95);
  const std::vector<std::string_view> dialects(std::begin(dialect_names), std::end(dialect_names));
  const std::string dialect = fields.choice("dialect", dialects, std::string(dialects.front()));
  if (const auto found = std::ranges::find(dialects, dialect); found != dialects.end())
    request.dialect = static_cast<Dialect>(found - dialects.begin());

  planning::Pose pose = now.pose.value_or(planning::Pose{});
  if (const json* start = fields.member("start_pose")) {
    Fields at(*start, fields.pointer("start_pose"));
    pose = {at.number("x_m", place), at.number("y_m", place), at.number("heading_rad", heading)};
    if (Result<void> done = at.finish(); !done) fields.fault(std::move(done.error()));
  }
  Charger charger;
  if (const json* given = fields.member("charger")) {
    Fields at(*given, fields.pointer("charger"));
    charger.at = planning::Point{at.number("x_m", place), at.number("y_m", place)};
    charger.detour = at.number("detour_factor", {.minimum = 1, .maximum = 100}, 1);
    if (Result<void> done = at.finish(); !done) fields.fault(std::move(done.error()));
  }
  double payload_kg = request.payload_kg.value_or(now.payload_kg.value_or(0));
  const std::optional<double> here_m = fields.optional_number("to_charger_m", way);
  request.from_here = to_charger(charger, pose, here_m, payload_kg);
  const bool charger_given = !request.from_here.empty();

  const json* tasks = fields.member("tasks");
  if (tasks == nullptr) return request;
  if (!tasks->is_array() || tasks->size() > max_tasks) {
    fields.fault("tasks", fmt::format("must be an array of at most {} tasks", max_tasks));
    return request;
  }
  request.tasks.reserve(tasks->size());
  for (std::size_t k = 0; k < tasks->size() && fields.ok(); ++k) {
    Fields own((*tasks)[k], fmt::format("{}/{}", fields.pointer("tasks"), k));
    TaskRequest task;
    task.name = own.text("name", 200, "");
    if (const auto carried = own.optional_number("payload_kg", payload)) payload_kg = *carried;
    task.pace = merged(read_pace(own), request.pace);
    task.legs = read_legs(own, pose, payload_kg);
    request.halts_stated =
        request.halts_stated || own.has("dwell_s") ||
        std::ranges::any_of(task.legs, [](const PlannedLeg& leg) { return leg.motion == Motion::stand; });
    for (const PlannedLeg& leg : task.legs)
      task.greatest_payload_kg = std::max(task.greatest_payload_kg, leg.payload_kg);
    const std::optional<double> distance_m = own.optional_number("to_charger_m", way);
    if (!distance_m && !charger.at && charger_given)
      own.fault("to_charger_m", "is required for every task where the charger's place is not given");
    if (distance_m && !charger_given)
      own.fault("to_charger_m", "needs the charger's place or \"to_charger_m\" of the request");
    task.to_charger = to_charger(charger, pose, distance_m, payload_kg);
    if (Result<void> done = own.finish(); !done) {
      fields.fault(std::move(done.error()));
    } else if (std::ranges::none_of(what_to_do, [&](std::string_view name) { return own.has(name); })) {
      fields.fault({Fault::invalid, own.pointer("path"),
                    fmt::format("is required where none of {} is given: a task drives or stands",
                                fmt::join(what_to_do.begin() + 1, what_to_do.end(), ", "))});
    }
    request.tasks.push_back(std::move(task));
  }
  return request;
}

bool depends_on_whereabouts(const json& request) {
  if (!request.is_object()) return false;
  return !request.contains("start_pose") || !request.contains("payload_kg");
}

}  // namespace joulecast::api
