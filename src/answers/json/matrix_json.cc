#include "answers/json/matrix_json.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "answers/json/drive_json.h"
#include "base/parallel.h"

namespace joulecast::answers {
namespace {

using Json = nlohmann::json;

using described::Count;
using described::Input;
using described::Nothing;
using described::Presence;
using described::within;
using planning::Leg;
using planning::MatrixTask;
using planning::Station;
using Robot = MatrixInput::Robot;

constexpr Count robots_of_matrix{1, 10'000}, tasks_of_matrix{1, 10'000};
constexpr std::size_t max_cells = 4'000'000;
constexpr Count parts_of_leg{0, 1'000};
constexpr std::size_t rows_per_piece = 16;
constexpr std::chrono::milliseconds tables_piece{20};  // most are there already, one to be built takes longer
constexpr std::size_t max_robot_id_bytes = 128, max_task_id_bytes = 200;
constexpr int places = 3;  // of energies and durations: millijoules and milliseconds
constexpr int probability_places = 4;
constexpr Bounds angle{.minimum = -planning::widest_turn_rad, .maximum = planning::widest_turn_rad};
constexpr Bounds leg_length{.minimum = 0, .maximum = planning::longest_leg_m};

const Input<Leg>& leg_input() {
  static const auto input = Input<Leg>("A route as segments, each driven from rest to rest")
                                .named("leg")
                                .numbers(
                                    "distances_m",
                                    [](Leg& leg, std::optional<std::vector<double>> given) {
                                      leg.distances_m = std::move(given).value_or(std::vector<double>());
                                    },
                                    parts_of_leg, leg_length, "lengths of the straight segments")
                                .numbers(
                                    "turns_rad",
                                    [](Leg& leg, std::optional<std::vector<double>> given) {
                                      leg.turns_rad = std::move(given).value_or(std::vector<double>());
                                    },
                                    parts_of_leg, angle, "turns in place, of either sign")
                                .number(
                                    "distance_m",
                                    [](Leg& leg, std::optional<double> given) {
                                      if (given) leg.distances_m.push_back(*given);
                                    },
                                    leg_length, "a further segment");
  return input;
}

const Input<Robot>& robot_input() {
  static const auto pose =
      Input<planning::Pose>()
          .include(point_input<planning::Pose>("place on the map"), std::identity())
          .number("heading_rad", &planning::Pose::heading_rad, heading_bounds_rad, heading_words, 0);
  static const auto input =
      Input<Robot>()
          .text("robot_id", &Robot::robot_id, max_robot_id_bytes, "the robot of this row")
          .object("pose", &Robot::pose, "start of the robot; default: its last reported pose", pose)
          .number("state_of_charge", &Robot::state_of_charge, fraction,
                  "state of charge; default: the live one");
  return input;
}

// A column of the request, for so many robots.
struct ReadTask {
  std::string task_id;
  MatrixTask task;
};
struct MatrixContext {
  std::size_t robots = 0;
};

void read_empty(Fields& fields, ReadTask& read, MatrixContext& context) {
  const Json* empty = fields.member("empty");
  if (empty == nullptr) return;
  const auto add = [&](const Json& leg, std::string at) {
    leg_input().nested(leg, std::move(at), read.task.empty.emplace_back(), context, fields);
  };
  if (!empty->is_array()) return add(*empty, fields.pointer("empty"));
  if (empty->size() != context.robots)
    fields.fault("empty", fmt::format("has {} legs, must have one for each of {} robots", empty->size(),
                                      context.robots));
  for (std::size_t k = 0; k < empty->size() && fields.ok(); ++k)
    add((*empty)[k], fmt::format("{}/{}", fields.pointer("empty"), k));
}

void check_stations(Fields& fields, ReadTask& read, MatrixContext&) {
  const MatrixTask& task = read.task;
  if (task.empty.empty() && !task.pickup) fields.fault("pickup", "is required where \"empty\" is not given");
  if (!task.loaded && (!task.pickup || !task.dropoff))
    fields.fault(task.pickup ? "dropoff" : "pickup", "is required where \"loaded\" is not given");
  if (fields.ok() && !task.loaded &&
      std::hypot(task.dropoff->x_m - task.pickup->x_m, task.dropoff->y_m - task.pickup->y_m) >
          planning::longest_leg_m)
    fields.fault("dropoff", fmt::format("is farther than {} m from the pick-up", planning::longest_leg_m));
}

// The time of a halt; a stated one replaces the usual ones.
auto halt(double MatrixTask::*dwell_s) {
  return [dwell_s](ReadTask& read, std::optional<double> given) {
    read.task.*dwell_s = given.value_or(0);
    read.task.halts_stated = read.task.halts_stated || given;
  };
}

const Input<ReadTask, MatrixContext>& matrix_task_input() {
  static const auto station =
      Input<Station>()
          .include(point_input<Station>("place on the map"), std::identity())
          .number("heading_rad", &Station::heading_rad, heading_bounds_rad,
                  "heading to which the robot turns there; default: its heading on arrival");
  constexpr auto task = &ReadTask::task;
  constexpr const char* dwell_words =
      "With driving usual: if either is stated, 0 included, the forecast contains no other halts; null: the "
      "usual ones";
  static const auto input =
      Input<ReadTask, MatrixContext>()
          .text("task_id", &ReadTask::task_id, max_task_id_bytes, "the caller's name of the task")
          .number("payload_kg", within(task, &MatrixTask::payload_kg), {.minimum = 0, .maximum = 1e5},
                  "carried from the pick-up to the drop-off", 0)
          .object("pickup", within(task, &MatrixTask::pickup),
                  "position of the pick-up; without it, \"empty\" contains the route there", station)
          .object("dropoff", within(task, &MatrixTask::dropoff),
                  "position of the drop-off; without it, \"loaded\" contains the route there", station)
          .custom(
              "empty",
              {{"oneOf", {leg_input().of_member(), {{"type", "array"}, {"items", leg_input().of_member()}}}}},
              "route to the pick-up, common to all robots or one for each in order; replaces a turn "
              "towards it and a straight line",
              read_empty)
          .object("loaded", within(task, &MatrixTask::loaded),
                  "a route as segments, each driven from rest to rest", leg_input())
          .number("pickup_dwell_s", halt(&MatrixTask::pickup_dwell_s), dwell_bounds_s,
                  std::string("time at rest at the pick-up. ").append(dwell_words))
          .number("dropoff_dwell_s", halt(&MatrixTask::dropoff_dwell_s), dwell_bounds_s,
                  std::string("time at rest at the drop-off. ").append(dwell_words))
          .check(check_stations);
  return input;
}

// Checked before any robot and task is read.
void check_size(Fields& fields, MatrixInput& input, MatrixContext& context) {
  if (input.driving == Driving::usual)
    for (const char* name : {"value_of_time_w", "regeneration"})
      if (fields.has(name))
        fields.fault(name, "must not be combined with \"driving\": \"usual\", which is not planned");
  const Json* robots = described::read_array(fields, "robots", robots_of_matrix, Presence::required);
  const Json* tasks = described::read_array(fields, "tasks", tasks_of_matrix, Presence::required);
  if (!fields.ok()) return;
  context.robots = robots->size();
  if (const std::size_t cells = robots->size() * tasks->size(); cells > max_cells)
    fields.fault({Fault::too_large, fields.pointer("tasks"),
                  fmt::format("{} robots by {} tasks are {} cells, at most {} are allowed", robots->size(),
                              tasks->size(), cells, max_cells)});
}

void write_row(JsonWriter& out, const MatrixRow& row) {
  out.begin_object();
  out.field("robot_id", row.robot_id).field("model_version", row.model_version);
  out.field("interpolation_error", row.interpolation_error).array("neglected_effects", row.neglected_effects);
  out.column("energy_j", row.energy_j, places).column("duration_s", row.duration_s, places);
  const auto column = [&](const char* name, const std::optional<std::vector<double>>& values, int digits) {
    if (values)
      out.column(name, *values, digits);
    else
      out.key(name).null();
  };
  column("success_probability", row.success_probability, probability_places);
  column("charge_needed", row.charge_needed, probability_places);
  column("available_in_s", row.available_in_s, places);
  if (row.siblings_pending) out.field("siblings_pending", true);
  out.key("infeasible").begin_array();
  for (const MatrixRow::Infeasible& why : row.infeasible) {
    out.begin_object().field("reason", planning::name_of(why.reason)).field("detail", why.detail);
    out.array("tasks", why.tasks).end_object();
  }
  out.end_array().end_object();
}

const Input<MatrixInput, MatrixContext>& matrix_input() {
  constexpr auto options = &MatrixInput::options;
  static const auto input =
      Input<MatrixInput, MatrixContext>("Robots and tasks for a cost matrix; at most 4,000,000 pairs")
          .choice("driving", &MatrixInput::driving, driving_names,
                  "driving model. minimum_energy: minimum-energy motions from stop to stop, equal for equal "
                  "robots and independent of their history; usual: each robot's own pace and the consumption "
                  "estimated from its missions, for fleets that do not drive the planner's profiles. "
                  "value_of_time_w and regeneration are valid only with minimum_energy",
                  static_cast<std::size_t>(Driving::minimum_energy))
          .number("value_of_time_w", within(options, &planning::CostOptions::value_of_time_w),
                  value_of_time_bounds_w, "value of time, added to the energy", 0)
          .number("regeneration", within(options, &planning::CostOptions::regeneration), fraction,
                  "recovered share of braking power; replaces that of each robot file")
          .number("reserve_fraction", &MatrixInput::reserve_fraction, fraction,
                  "charge to be left after a task, for its success probability; default the robot file's")
          .check(check_size)
          .list("robots", &MatrixInput::robots, robots_of_matrix,
                "the rows: ids of robots, or robots with a pose and a charge",
                described::OrText(&Robot::robot_id, "robot id; the start is its last reported pose",
                                  robot_input()))
          .list(
              "tasks",
              [](MatrixInput& matrix, ReadTask&& read) {
                matrix.task_ids.push_back(std::move(read.task_id));
                matrix.tasks.push_back(std::move(read.task));
              },
              tasks_of_matrix, "the columns", matrix_task_input());
  return input;
}

}  // namespace

described::Schemas matrix_request_schemas() {
  return {{"energy-matrix-request", matrix_input().schema()}, {"leg", leg_input().schema()}};
}

Result<MatrixInput> read_matrix(const Json& request) {
  return matrix_input().read(request);
}

bool MatrixText::next(std::string& out, const std::stop_token& left) {
  if (left.stop_requested()) return false;
  const bool more = matrix_.prepare(tables_piece, left);
  if (left.stop_requested()) return false;
  if (more) return true;
  const MatrixInput& input = matrix_.input();
  if (!begun_) {
    JsonWriter head;
    head.begin_object().field("driving", name_of(input.driving));
    head.field("value_of_time_w", input.options.value_of_time_w).array("tasks", input.task_ids);
    out += head.text();
    out += ",\"rows\":[";
    begun_ = true;
  }
  const std::size_t count = std::min(rows_per_piece, input.robots.size() - rows_done_);
  std::array<JsonWriter, rows_per_piece> rows;
  parallel_for(count, 2, [&](std::size_t k) {
    if (!left.stop_requested()) write_row(rows[k], matrix_.row(rows_done_ + k));
  });
  if (left.stop_requested()) return false;
  for (std::size_t k = 0; k < count; ++k) {
    if (rows_done_ + k > 0) out += ',';
    out += rows[k].text();
  }
  rows_done_ += count;
  if (rows_done_ < input.robots.size()) return true;
  out += "]}";
  return false;
}

}  // namespace joulecast::answers
