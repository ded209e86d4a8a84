#include "answers/json/estimate_json.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "answers/json/drive_json.h"
#include "answers/json/ledger_json.h"
#include "base/try.h"

namespace joulecast::answers {
namespace {

using Json = nlohmann::json;

constexpr std::size_t max_profile_points = 200'000;

std::vector<energy::MotionPoint> read_points(const Json& given, Fields& outer) {
  Fields profile(given, outer.pointer("profile"));
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
    profile.fault("climb_rad", "must not be combined with height_m, from which it follows");
  for (const auto& [name, column] : {std::pair{"climb_rad", &climb}, {"height_m", &height}})
    if (profile.ok() && column->size() != t.size())
      profile.fault(name, "must have as many entries as time_s");
  if (Result<void> done = profile.finish(); !done) outer.fault(std::move(done.error()));
  if (!outer.ok()) return {};
  std::vector<energy::MotionPoint> points(t.size());
  for (std::size_t k = 0; k < t.size(); ++k) points[k] = {t[k], v[k], yaw[k], climb[k], height[k]};
  return points;
}

GivenMotion read_motion(const Json& profile, Fields& fields, const robot::RobotModel& robot) {
  GivenMotion motion;
  motion.points = read_points(profile, fields);
  motion.payload_kg = fields.number("payload_kg", {.minimum = 0, .maximum = robot.limits.payload_kg}, 0);
  if (const auto pose = read_start_pose(fields)) motion.start = {pose->x_m, pose->y_m, pose->heading_rad};
  return motion;
}

// Rejects members that apply only to a planned motion.
void refuse_beside_usual(Fields& fields, bool columns) {
  if (columns) fields.fault("columns", "must be false beside \"driving\": \"usual\", which is not planned");
  for (const char* name :
       {"deadline_s", "value_of_time_w", "start_speed_m_s", "end_speed_m_s", "regeneration", "limits"})
    if (fields.has(name))
      fields.fault(name, "must not be combined with \"driving\": \"usual\", which is not planned");
}

}  // namespace

Result<EstimateInput> read_estimate(const Json& request, const robot::RobotModel& robot) {
  Fields fields(request);
  EstimateInput input;
  input.columns = fields.boolean("columns", false);
  if (const Json* profile = fields.member("profile")) {
    input.motion = read_motion(*profile, fields, robot);
  } else {
    input.driving = read_driving(fields, Driving::minimum_energy);
    input.motion = read_drive(fields, robot);
    if (input.driving == Driving::usual) refuse_beside_usual(fields, input.columns);
  }
  TRY(fields.finish());
  return input;
}

std::string estimate_json(const EstimateInput& input, const EstimateOutput& output,
                          const ModelInForce& model) {
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  const bool given = std::holds_alternative<GivenMotion>(input.motion);
  json.field("driving", given ? "given" : name_of(input.driving));
  json.field("energy_j", output.energy_j).field("duration_s", output.duration_s);
  json.field("distance_m", output.distance_m).field("turned_rad", output.turned_rad);
  if (output.energy_quantiles_j) {
    write_quantiles(json, "energy_quantiles_j", *output.energy_quantiles_j);
  } else {
    json.key("energy_quantiles_j").null();
  }
  if (output.siblings_pending) json.field("siblings_pending", true);
  json.key("beyond_limits").begin_array();
  for (const planning::BrokenLimit& broken : output.beyond_limits) {
    json.begin_object().field("limit", broken.limit);
    json.field("reached", broken.reached).field("allowed", broken.allowed).end_object();
  }
  json.end_array();
  json.key("ledger");
  if (output.accounts) {
    ledger_table().write(json, *output.accounts);
  } else {
    json.null();
  }
  if (output.columns) write_profile_columns(json, *output.columns);
  json.end_object();
  return json.take();
}

Result<std::string> estimate_answer(const Json& request, const RobotOutlook& robot) {
  TRY_ASSIGN(const auto input, read_estimate(request, robot.model->robot));
  TRY_ASSIGN(const auto output, estimate(input, robot));
  return estimate_json(input, output, *robot.model);
}

}  // namespace joulecast::answers
