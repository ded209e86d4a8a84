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

constexpr std::size_t max_robots = 10'000;
constexpr std::size_t max_matrix_tasks = 10'000;
// Of minimum-energy and of usual driving, which takes ten times the work, 11 s of CPU for so many.
constexpr std::size_t max_cells = 4'000'000, max_usual_cells = 1'000'000;
constexpr std::size_t max_stretches = 1'000;
constexpr std::size_t rows_per_piece = 16;
constexpr std::chrono::milliseconds tables_piece{20};  // most are there already, one to be built takes longer
constexpr std::size_t max_robot_id_bytes = 128, max_task_id_bytes = 200;
constexpr int places = 3;  // of energies and durations: millijoules and milliseconds
constexpr int probability_places = 4;
constexpr Bounds angle{.minimum = -planning::widest_turn_rad, .maximum = planning::widest_turn_rad};
constexpr Bounds leg_length{.minimum = 0, .maximum = planning::longest_leg_m};

// The elements of an array member; the fault states the allowed number.
const Json* read_array(Fields& fields, std::string_view name, std::size_t most) {
  const Json* member = fields.required(name);
  if (member == nullptr) return nullptr;
  if (!member->is_array() || member->empty() || member->size() > most) {
    fields.fault(name, fmt::format("must be an array of 1 to {} entries", most));
    return nullptr;
  }
  return member;
}

void finish(Fields& inner, Fields& outer) {
  if (Result<void> done = inner.finish(); !done) outer.fault(std::move(done.error()));
}

planning::Leg read_leg(const Json& value, std::string at, Fields& outer) {
  Fields fields(value, std::move(at));
  planning::Leg leg;
  if (fields.has("distances_m"))
    leg.distances_m = fields.numbers("distances_m", 0, max_stretches, leg_length);
  if (fields.has("turns_rad")) leg.turns_rad = fields.numbers("turns_rad", 0, max_stretches, angle);
  if (const auto distance = fields.optional_number("distance_m", leg_length))
    leg.distances_m.push_back(*distance);
  finish(fields, outer);
  return leg;
}

std::optional<planning::Station> read_station(Fields& fields, std::string_view name) {
  const Json* member = fields.member(name);
  if (member == nullptr) return std::nullopt;
  Fields at(*member, fields.pointer(name));
  planning::Station station{at.number("x_m", position_bounds_m), at.number("y_m", position_bounds_m),
                            at.optional_number("heading_rad", {.minimum = -1e3, .maximum = 1e3})};
  finish(at, fields);
  return station;
}

MatrixInput::Robot read_robot(const Json& value, std::string at, Fields& outer) {
  if (value.is_string()) return {value.get<std::string>(), {}, {}};
  MatrixInput::Robot robot;
  Fields fields(value, std::move(at));
  robot.robot_id = fields.text("robot_id", max_robot_id_bytes);
  if (const Json* pose = fields.member("pose")) {
    Fields own(*pose, fields.pointer("pose"));
    robot.pose = {own.number("x_m", position_bounds_m), own.number("y_m", position_bounds_m),
                  own.number("heading_rad", {.minimum = -1e3, .maximum = 1e3}, 0)};
    finish(own, fields);
  }
  robot.state_of_charge = fields.optional_number("state_of_charge", fraction);
  finish(fields, outer);
  return robot;
}

planning::MatrixTask read_task(const Json& value, std::string at, std::size_t robots, std::string& task_id,
                               Fields& outer) {
  Fields fields(value, std::move(at));
  planning::MatrixTask task;
  task_id = fields.text("task_id", max_task_id_bytes);
  task.payload_kg = fields.number("payload_kg", {.minimum = 0, .maximum = 1e5}, 0);
  task.pickup = read_station(fields, "pickup");
  task.dropoff = read_station(fields, "dropoff");
  if (const Json* empty = fields.member("empty")) {
    if (empty->is_array()) {
      if (empty->size() != robots)
        fields.fault("empty",
                     fmt::format("has {} legs, must have one for each of {} robots", empty->size(), robots));
      for (std::size_t k = 0; k < empty->size() && fields.ok(); ++k)
        task.empty.push_back(read_leg((*empty)[k], fmt::format("{}/{}", fields.pointer("empty"), k), fields));
    } else {
      task.empty.push_back(read_leg(*empty, fields.pointer("empty"), fields));
    }
  }
  if (const Json* loaded = fields.member("loaded"))
    task.loaded = read_leg(*loaded, fields.pointer("loaded"), fields);
  const auto pickup_dwell_s = fields.optional_number("pickup_dwell_s", dwell_bounds_s);
  const auto dropoff_dwell_s = fields.optional_number("dropoff_dwell_s", dwell_bounds_s);
  task.pickup_dwell_s = pickup_dwell_s.value_or(0);
  task.dropoff_dwell_s = dropoff_dwell_s.value_or(0);
  task.halts_stated = pickup_dwell_s || dropoff_dwell_s;
  if (task.empty.empty() && !task.pickup) fields.fault("pickup", "is required where \"empty\" is not given");
  if (!task.loaded && (!task.pickup || !task.dropoff))
    fields.fault(task.pickup ? "dropoff" : "pickup", "is required where \"loaded\" is not given");
  if (fields.ok() && !task.loaded &&
      std::hypot(task.dropoff->x_m - task.pickup->x_m, task.dropoff->y_m - task.pickup->y_m) >
          planning::longest_leg_m)
    fields.fault("dropoff", fmt::format("is farther than {} m from the pick-up", planning::longest_leg_m));
  finish(fields, outer);
  return task;
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

}  // namespace

Result<MatrixInput> read_matrix(const Json& request) {
  Fields fields(request);
  MatrixInput input;
  input.driving = read_driving(fields, Driving::minimum_energy);
  input.options.value_of_time_w = fields.number("value_of_time_w", {.minimum = 0, .maximum = 1e6}, 0);
  input.options.regeneration = fields.optional_number("regeneration", fraction);
  if (input.driving == Driving::usual)
    for (const char* name : {"value_of_time_w", "regeneration"})
      if (fields.has(name))
        fields.fault(name, "must not be combined with \"driving\": \"usual\", which is not planned");
  input.reserve_fraction = fields.optional_number("reserve_fraction", fraction);
  const Json* robots = read_array(fields, "robots", max_robots);
  const Json* tasks = read_array(fields, "tasks", max_matrix_tasks);
  const bool usual = input.driving == Driving::usual;
  const std::size_t most = usual ? max_usual_cells : max_cells;
  if (fields.ok() && robots->size() * tasks->size() > most)
    fields.fault(
        {Fault::too_large, fields.pointer("tasks"),
         fmt::format("{} robots by {} tasks are {} cells, at most {} are allowed{}", robots->size(),
                     tasks->size(), robots->size() * tasks->size(), most, usual ? " of usual driving" : "")});
  for (std::size_t k = 0; fields.ok() && k < robots->size(); ++k)
    input.robots.push_back(read_robot((*robots)[k], fmt::format("/robots/{}", k), fields));
  for (std::size_t k = 0; fields.ok() && k < tasks->size(); ++k)
    input.tasks.push_back(read_task((*tasks)[k], fmt::format("/tasks/{}", k), robots->size(),
                                    input.task_ids.emplace_back(), fields));
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  return input;
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
