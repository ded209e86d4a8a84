#include "answers/json/autonomy_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "answers/json/drive_json.h"
#include "base/try.h"

namespace joulecast::answers {
namespace {

constexpr std::size_t max_autonomy_tasks = 1000;
constexpr std::size_t max_id_bytes = 200;
constexpr Bounds payload{.minimum = 0, .maximum = 1e6};
constexpr Bounds way{.minimum = 0, .maximum = 1e6};
constexpr std::array<std::string_view, 4> what_to_do{"path", "turn_rad", "distance_m", "dwell_s"};

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

// `placed` is whether the task begins at a known place, and becomes whether it ends at one.
AutonomyTask read_task(const nlohmann::json& value, std::string at, const AutonomyInput& input, bool& placed,
                       Fields& outer) {
  Fields own(value, std::move(at));
  AutonomyTask task;
  task.task_id = own.text("task_id", max_id_bytes, "");
  task.payload_kg = own.optional_number("payload_kg", payload);
  task.pace = merged(read_pace(own), input.pace);
  if (own.has("path")) {
    task.path = read_path(own, payload.maximum);
  } else {
    task.turn_rad = own.number("turn_rad", {.minimum = -1e3, .maximum = 1e3}, 0);
    task.distance_m = own.number("distance_m", way, 0);
    placed = placed && (task.distance_m == 0 || own.has("turn_rad"));
  }
  task.dwell_s = own.optional_number("dwell_s", dwell_bounds_s);
  task.to_charger_m = own.optional_number("to_charger_m", way);
  if (!task.to_charger_m && !input.charger && input.to_charger_m)
    own.fault("to_charger_m", "is required for every task where the charger's place is not given");
  if (!task.to_charger_m && input.charger && !placed)
    own.fault(
        "to_charger_m",
        "is required after a task that states distance_m without turn_rad, which ends at no known place");
  if (task.to_charger_m && !input.charger && !input.to_charger_m)
    own.fault("to_charger_m", "needs the charger's place or \"to_charger_m\" of the request");
  if (Result<void> done = own.finish(); !done) {
    outer.fault(std::move(done.error()));
  } else if (std::ranges::none_of(what_to_do, [&](std::string_view name) { return own.has(name); })) {
    outer.fault({Fault::invalid, own.pointer("path"),
                 fmt::format("is required where none of {} is given: a task drives or stands",
                             fmt::join(what_to_do.begin() + 1, what_to_do.end(), ", "))});
  }
  return task;
}

std::optional<Charger> read_charger(Fields& fields) {
  const nlohmann::json* given = fields.member("charger");
  if (given == nullptr) return std::nullopt;
  Fields at(*given, fields.pointer("charger"));
  const Charger charger{{at.number("x_m", position_bounds_m), at.number("y_m", position_bounds_m)},
                        at.number("detour_factor", {.minimum = 1, .maximum = 100}, 1)};
  if (Result<void> done = at.finish(); !done) fields.fault(std::move(done.error()));
  return charger;
}

void write_place(JsonWriter& json, std::string_view name, const std::optional<std::size_t>& index,
                 const AutonomyInput& input) {
  json.key(name);
  if (!index) {
    json.null();
    return;
  }
  json.begin_object();
  json.key("task");
  *index < input.tasks.size() ? json.value(static_cast<std::int64_t>(*index)) : json.null();
  json.key("task_id");
  *index < input.tasks.size() ? json.value(input.tasks[*index].task_id) : json.null();
  json.end_object();
}

void write_stage(JsonWriter& json, const forecast::TaskOutlook& stage) {
  json.field("expected_energy_j", stage.mean_j).field("ends_after_s", stage.duration_s);
  json.field("success_probability", stage.probability);
  write_quantiles(json, "energy_since_start_j", stage.energy_j);
  write_quantiles(json, "arrival_charge", stage.charge);
}

void write_outlook(JsonWriter& json, const forecast::Outlook& outlook, const AutonomyInput& input) {
  json.begin_object();
  json.field("success_probability", outlook.probability);
  json.field("expected_energy_j", outlook.mean_j).field("duration_s", outlook.duration_s[1]);
  write_quantiles(json, "energy_j", outlook.energy_j);
  write_quantiles(json, "duration_quantiles_s", outlook.duration_s);
  json.key("legs").begin_array();
  for (std::size_t k = 0; k < outlook.tasks.size(); ++k) {
    json.begin_object().field("task_id", input.tasks[k].task_id);
    write_stage(json, outlook.tasks[k]);
    json.end_object();
  }
  json.end_array();
  json.key("charger");
  if (outlook.charger) {
    json.begin_object();
    write_stage(json, *outlook.charger);
    json.end_object();
  } else {
    json.null();
  }
  write_place(json, "fails_at", outlook.fails_at, input);
  write_place(json, "likeliest_failure", outlook.likeliest_failure, input);
  json.key("latest_departure");
  if (outlook.latest_departure) {
    const forecast::Departure& leave = *outlook.latest_departure;
    json.begin_object().field("after_tasks", static_cast<std::int64_t>(leave.after_tasks));
    json.field("at_s", leave.at_s).field("wait_s", leave.wait_s).field("latest_s", leave.at_s + leave.wait_s);
    json.field("probability", leave.probability).field("confidence", input.confidence).end_object();
  } else {
    json.null();
  }
  json.end_object();
}

// The phase of charging and the time until the battery would be charged.
void write_charging(JsonWriter& json, const AutonomyOutput& a, const LiveRobot& now) {
  const LiveRobot known = a.charge_is_live ? now : LiveRobot{};
  json.key("charging");
  battery::at_charger(known.charging) ? json.value(battery::name(known.charging)) : json.null();
  json.field("time_to_charged_s", known.to_full.duration_s);
  json.field("time_to_charged_sd_s", known.to_full.sd_s);
}

void write_end(JsonWriter& json, const forecast::Outlook& o) {
  json.field("success_probability", o.probability);
  json.field("expected_energy_j", o.mean_j).field("duration_s", o.duration_s[1]);
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  write_quantiles(json, "arrival_charge",
                  o.charger         ? o.charger->charge
                  : o.tasks.empty() ? std::array{none, none, none}
                                    : o.tasks.back().charge);
}

void write_minimum_energy(JsonWriter& json, const AutonomyOutput& a) {
  json.key("minimum_energy");
  if (!a.minimum_energy_outlook || !a.outlook) {
    json.null();
    return;
  }
  const forecast::Outlook &best = *a.minimum_energy_outlook, &usual = *a.outlook;
  json.begin_object();
  write_end(json, best);
  json.field("saved_j", usual.mean_j - best.mean_j);
  json.field("saved_s", usual.duration_s[1] - best.duration_s[1]);
  json.end_object();
}

void write_fastest(JsonWriter& json, const AutonomyOutput& a) {
  json.key("fastest");
  if (!a.fastest) {
    json.null();
    return;
  }
  json.begin_object().field("value_of_time_w", a.fastest->value_of_time_w);
  write_end(json, a.fastest->outlook);
  json.end_object();
}

}  // namespace

AutonomyRequest read_autonomy(Fields& fields, bool single) {
  AutonomyRequest request;
  AutonomyInput& input = request.input;
  input.state_of_charge = fields.optional_number("state_of_charge", fraction);
  input.state_of_charge_sd = fields.optional_number("state_of_charge_sd", {.minimum = 0, .maximum = 0.5});
  input.reserve_fraction = fields.optional_number("reserve_fraction", fraction);
  input.payload_kg = fields.optional_number("payload_kg", payload);
  input.driving = read_driving(fields, Driving::usual);
  input.compare_minimum_energy =
      fields.boolean("compare_minimum_energy", single) && input.driving == Driving::usual;
  input.compare_fastest = fields.boolean("compare_fastest", false);
  input.value_of_time_w =
      fields.number("value_of_time_w", {.minimum = 0, .maximum = most_value_of_time_w}, 0);
  input.pace = read_pace(fields);
  input.confidence = fields.number("confidence", {.minimum = 0.01, .maximum = 0.999}, 0.95);
  const std::vector<std::string_view> dialects(std::begin(dialect_names), std::end(dialect_names));
  const std::string dialect = fields.choice("dialect", dialects, std::string(dialects.front()));
  if (const auto found = std::ranges::find(dialects, dialect); found != dialects.end())
    request.dialect = static_cast<Dialect>(found - dialects.begin());
  input.start_pose = read_start_pose(fields);
  input.charger = read_charger(fields);
  input.to_charger_m = fields.optional_number("to_charger_m", way);
  const nlohmann::json* tasks = fields.member("tasks");
  if (tasks == nullptr) return request;
  if (!tasks->is_array() || tasks->size() > max_autonomy_tasks) {
    fields.fault("tasks", fmt::format("must be an array of at most {} tasks", max_autonomy_tasks));
    return request;
  }
  input.tasks.reserve(tasks->size());
  bool placed = true;
  for (std::size_t k = 0; k < tasks->size() && fields.ok(); ++k)
    input.tasks.push_back(
        read_task((*tasks)[k], fmt::format("{}/{}", fields.pointer("tasks"), k), input, placed, fields));
  return request;
}

std::string autonomy_json(const AutonomyRequest& request, const AutonomyOutput& a, const RobotOutlook& robot,
                          const LiveRobot& now) {
  const AutonomyInput& input = request.input;
  if (request.dialect != Dialect::joulecast) {
    return battery_dialect(
        request.dialect, battery_status(robot.model->robot.battery, *robot.battery, a.charge, a.reach, now));
  }
  const forecast::Forecaster& forecaster = *robot.forecaster;
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", robot.model->robot.robot_id).field("model_version", robot.model->version);
  json.field("state_of_charge", a.charge.fraction).field("state_of_charge_sd", a.charge.deviation);
  json.field("reserve_fraction", a.charge.reserve);
  write_charging(json, a, now);
  json.field("usable_energy_j", a.reach.usable_j).field("usable_energy_sd_j", a.reach.usable_deviation_j);
  json.field("payload_kg", a.payload_kg);
  json.field("driving", input.driving == Driving::minimum_energy ? "minimum_energy"
                        : a.track == forecast::Driving::stated   ? "stated"
                                                                 : "usual");
  json.key("pace").begin_object();
  const forecast::Pace& pace =
      a.limitation && input.driving != Driving::minimum_energy ? a.limitation->reached : a.pace;
  json.field("speed_m_s", pace.speed_m_s).field("acceleration_m_s2", pace.acceleration_m_s2);
  json.field("yaw_rate_rad_s", pace.yaw_rate_rad_s).field("pause_s", pace.pause_s);
  json.key("limitation");
  a.limitation ? json.value(a.limitation->sentence) : json.null();
  json.end_object();
  json.key("consumption").begin_object();
  json.field("basis", forecaster.missions > 0   ? "recent_missions"
                      : forecaster.siblings > 0 ? "siblings"
                                                : "model");
  json.field("missions", forecaster.missions).field("siblings", forecaster.siblings);
  json.field("siblings_pending", robot.siblings_pending);
  json.field("energy_per_m_j", a.reach.energy_per_m_j).field("mean_power_w", a.reach.mean_power_w);
  const forecast::Forecaster::Track& track =
      forecaster.track(a.track == forecast::Driving::stated ? forecast::Subject::stated_energy
                                                            : forecast::Subject::usual_energy);
  json.field("common_deviation", track.inflation * track.common);
  json.field("leg_deviation",
             track.inflation * track.scatter[static_cast<std::size_t>(forecast::Motion::drive)]);
  json.end_object();
  json.field("range_m", a.reach.range_m[1]).field("run_time_s", a.reach.run_time_s[1]);
  write_quantiles(json, "range_quantiles_m", a.reach.range_m);
  write_quantiles(json, "run_time_quantiles_s", a.reach.run_time_s);
  json.key("drift");
  if (forecaster.drift) {
    write_drift(json, *forecaster.drift);
  } else {
    json.null();
  }
  json.key("plan");
  if (a.outlook) {
    write_outlook(json, *a.outlook, input);
  } else {
    json.null();
  }
  write_minimum_energy(json, a);
  write_fastest(json, a);
  json.end_object();
  return json.take();
}

Result<std::string> autonomy_answer(const nlohmann::json& request, const RobotOutlook& robot,
                                    const LiveRobot& now, planning::CostTableCache& tables,
                                    const std::stop_token& stop) {
  Fields fields(request);
  const AutonomyRequest read = read_autonomy(fields, true);
  TRY(fields.finish());
  TRY_ASSIGN(const auto plan, task_plan(read.input, now));
  TRY_ASSIGN(const auto output, autonomy(read.input, plan, robot, now, tables, stop));
  return autonomy_json(read, output, robot, now);
}

void write_drift(JsonWriter& json, const forecast::Drift& drift) {
  json.begin_object().time("since", drift.since_utime_us);
  json.time("detected", drift.detected_utime_us).field("ratio", drift.ratio);
  json.field("missions", drift.missions).end_object();
}

}  // namespace joulecast::answers
