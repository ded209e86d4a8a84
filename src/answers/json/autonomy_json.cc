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

using described::Input;
using described::Presence;
using described::within;

constexpr described::Count tasks_of_autonomy{0, 1000, "tasks"};
constexpr std::size_t max_id_bytes = 200;
constexpr Bounds payload{.minimum = 0, .maximum = 1e6};
constexpr Bounds way{.minimum = 0, .maximum = 1e6};
constexpr std::array<std::string_view, 4> what_to_do{"path", "turn_rad", "distance_m", "dwell_s"};

// The members of the request that its tasks depend on.
struct AutonomyContext : PathContext {
  const AutonomyInput* input = nullptr;
  bool placed = true;  // the next task begins at a known place
};

const Input<StatedPace>& pace_input() {
  static const auto input =
      Input<StatedPace>()
          .number("speed_m_s", &StatedPace::speed_m_s, positive,
                  "stated cruise speed; if ramps are stated too, the forecast contains no halts after drives")
          .number("acceleration_m_s2", &StatedPace::acceleration_m_s2, positive,
                  "acceleration of ramps in drives")
          .number("yaw_rate_rad_s", &StatedPace::yaw_rate_rad_s, positive, "cruise rate of turns in place")
          .number("yaw_acceleration_rad_s2", &StatedPace::yaw_acceleration_rad_s2, positive,
                  "acceleration of ramps in turns in place");
  return input;
}

void take_common_pace(Fields&, AutonomyTask& task, AutonomyContext& context) {
  for (const auto member : {&StatedPace::speed_m_s, &StatedPace::acceleration_m_s2,
                            &StatedPace::yaw_rate_rad_s, &StatedPace::yaw_acceleration_rad_s2})
    if (!(task.pace.*member)) task.pace.*member = context.input->pace.*member;
}

void check_charger(Fields& fields, AutonomyTask& task, AutonomyContext& context) {
  const AutonomyInput& input = *context.input;
  if (!task.to_charger_m && !input.charger && input.to_charger_m)
    fields.fault("to_charger_m", "is required for every task where the charger's place is not given");
  if (!task.to_charger_m && input.charger && !context.placed)
    fields.fault(
        "to_charger_m",
        "is required after a task that states distance_m without turn_rad, which ends at no known place");
  if (task.to_charger_m && !input.charger && !input.to_charger_m)
    fields.fault("to_charger_m", "needs the charger's place or \"to_charger_m\" of the request");
}

void check_something_to_do(Fields& fields, AutonomyTask&, AutonomyContext&) {
  if (std::ranges::none_of(what_to_do, [&](std::string_view name) { return fields.has(name); }))
    fields.fault("path", fmt::format("is required where none of {} is given: a task drives or stands",
                                     fmt::join(what_to_do.begin() + 1, what_to_do.end(), ", ")));
}

const Input<AutonomyTask, AutonomyContext>& task_input() {
  using Part = Input<AutonomyTask, AutonomyContext>;
  static const auto along_path = Part().include(path_input(), &AutonomyTask::path);
  static const auto straight = Part()
                                   .number("turn_rad", &AutonomyTask::turn_rad,
                                           {.minimum = -1e3, .maximum = 1e3}, "turn in place first", 0)
                                   .number("distance_m", &AutonomyTask::distance_m, way,
                                           "then drive so far; straight where turn_rad is stated", 0)
                                   .check([](Fields& fields, AutonomyTask& task, AutonomyContext& context) {
                                     context.placed =
                                         context.placed && (task.distance_m == 0 || fields.has("turn_rad"));
                                   });
  static const auto input =
      Part(
          "A task of a list",
          "drive, then dwell; each task begins where the one before ended; one of path, turn_rad, distance_m "
          "and dwell_s at least; path replaces turn_rad and distance_m")
          .named("task")
          .text("task_id", &AutonomyTask::task_id, max_id_bytes, "the caller's name of the task", "")
          .number("payload_kg", &AutonomyTask::payload_kg, payload, "carried from here on; absent: as before")
          .include(pace_input(), &AutonomyTask::pace)
          .check(take_common_pace)
          .either("path", along_path, straight)
          .number("dwell_s", &AutonomyTask::dwell_s, dwell_bounds_s,
                  "time at rest at the end of the task. If any task states it, 0 included, the forecast "
                  "contains no other halts")
          .number(
              "to_charger_m", &AutonomyTask::to_charger_m, way,
              "distance from this task's end to the charger; required where the charger's position is not "
              "given, and from a task on that states distance_m without turn_rad, which ends at no known "
              "place")
          .check(check_charger)
          .finally(check_something_to_do);
  return input;
}

const Input<AutonomyRequest, AutonomyContext>& autonomy_input() {
  static const auto charger =
      Input<Charger>()
          .include(point_input<planning::Point>("place of the charger on the map"), &Charger::at)
          .number("detour_factor", &Charger::detour_factor, {.minimum = 1, .maximum = 100},
                  "of the way to it over the straight line", 1);
  constexpr auto in = &AutonomyRequest::input;
  static const auto input =
      Input<AutonomyRequest, AutonomyContext>(
          "Conditions of an autonomy forecast; with an empty object, those of the robot at present")
          .named("autonomy-request")
          .number("state_of_charge", within(in, &AutonomyInput::state_of_charge), fraction,
                  "state of charge; default: the live one")
          .number("state_of_charge_sd", within(in, &AutonomyInput::state_of_charge_sd),
                  {.minimum = 0, .maximum = 0.5}, "standard deviation of state_of_charge")
          .number("reserve_fraction", within(in, &AutonomyInput::reserve_fraction), fraction,
                  "charge to be left at the end; default: that of the robot file")
          .number("payload_kg", within(in, &AutonomyInput::payload_kg), payload,
                  "present payload; default: the live one, else 0")
          .choice("driving", within(in, &AutonomyInput::driving), driving_names,
                  "driving model. usual: at the robot's own pace or the stated one, which predicts how long "
                  "the charge lasts in operation; minimum_energy: along the planner's profiles",
                  static_cast<std::size_t>(Driving::usual))
          .boolean(
              "compare_minimum_energy",
              [](AutonomyRequest& request, std::optional<bool> given) {
                bool& compare = request.input.compare_minimum_energy;
                compare = given.value_or(compare) && request.input.driving == Driving::usual;
              },
              "report what minimum-energy profiles would change; default true for one robot, false for a "
              "fleet")
          .boolean("compare_fastest", within(in, &AutonomyInput::compare_fastest),
                   "report the fastest minimum-energy profiles with which the plan ends with the reserve at "
                   "the probability confidence",
                   false)
          .number("value_of_time_w", within(in, &AutonomyInput::value_of_time_w), value_of_time_bounds_w,
                  "value of time in minimum-energy profiles, W; the time_multiplier_w of a profile's "
                  "certificate, with or without a deadline, reproduces that profile",
                  0)
          .include(pace_input(), within(in, &AutonomyInput::pace))
          .number("confidence", within(in, &AutonomyInput::confidence), {.minimum = 0.01, .maximum = 0.999},
                  "probability for the latest departure", 0.95)
          .choice("dialect", &AutonomyRequest::dialect, dialect_names,
                  "format of the response: that of this service or a battery message of another standard",
                  static_cast<std::size_t>(Dialect::joulecast))
          .object("start_pose", within(in, &AutonomyInput::start_pose),
                  "start of the tasks; default: the robot's position, else the origin", pose_input())
          .object("charger", within(in, &AutonomyInput::charger),
                  "charger at which the plan ends: reached by a turn and a straight line, its length times "
                  "detour_factor",
                  charger)
          .number("to_charger_m", within(in, &AutonomyInput::to_charger_m), way,
                  "distance from the start to the charger, if its position is not given")
          .check([](Fields&, AutonomyRequest& request, AutonomyContext& context) {
            context.input = &request.input;
          })
          .list("tasks", within(in, &AutonomyInput::tasks), tasks_of_autonomy,
                "tasks in the order of execution; null or absent: no task forecast", task_input(),
                Presence::optional);
  return input;
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

described::Schemas autonomy_request_schemas() {
  described::Schema task = task_input().schema();
  for (const std::string_view name : what_to_do) task["anyOf"].push_back({{"required", {name}}});
  return {{"autonomy-request", autonomy_input().schema()}, {"task", std::move(task)}};
}

Result<AutonomyRequest> read_autonomy(const nlohmann::json& body, bool single, const std::string& at) {
  AutonomyRequest request;
  request.input.compare_minimum_energy = single;
  AutonomyContext context;
  context.payload_limit_kg = payload.maximum;
  return autonomy_input().read(body, std::move(request), context, at);
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
  TRY_ASSIGN(const AutonomyRequest read, read_autonomy(request, true));
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
