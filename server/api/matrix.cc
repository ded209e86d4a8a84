#include "server/api/matrix.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "planning/cost_matrix.h"
#include "server/api/autonomy.h"
#include "server/api/fields.h"
#include "server/api/json_writer.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

using nlohmann::json;
using planning::Cell;
using planning::CostTable;
using planning::Obstacle;

constexpr std::size_t max_robots = 10'000;
constexpr std::size_t max_tasks = 10'000;
constexpr std::size_t max_cells = 4'000'000;
constexpr std::size_t max_stretches = 1'000;
constexpr std::size_t rows_per_piece = 16;
constexpr std::chrono::milliseconds tables_piece{20};  // most are there already, one to be built takes longer
constexpr std::size_t max_id_bytes = 128;
constexpr int places = 3;  // of energies and durations: millijoules and milliseconds
constexpr Bounds place{.minimum = -1e6, .maximum = 1e6};
constexpr Bounds angle{.minimum = -planning::widest_turn_rad, .maximum = planning::widest_turn_rad};
constexpr Bounds leg_length{.minimum = 0, .maximum = planning::longest_leg_m};
constexpr Bounds dwell{.minimum = 0, .maximum = 1e7};

// The elements of an array member; the fault says how many there may be.
const json* read_array(Fields& fields, std::string_view name, std::size_t most) {
  const json* member = fields.required(name);
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

planning::Leg read_leg(const json& value, std::string at, Fields& outer) {
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
  const json* member = fields.member(name);
  if (member == nullptr) return std::nullopt;
  Fields at(*member, fields.pointer(name));
  planning::Station station{at.number("x_m", place), at.number("y_m", place),
                            at.optional_number("heading_rad", {.minimum = -1e3, .maximum = 1e3})};
  finish(at, fields);
  return station;
}

struct RobotRow {
  std::string robot_id;
  std::shared_ptr<const server::ModelInForce> model;  // null: see `problem`
  std::string problem;
  std::optional<planning::Pose> pose;
  std::optional<double> state_of_charge;
  server::RobotOutlook outlook;
  forecast::Charge charge;  // NaN: not known
};

RobotRow read_robot(const json& value, std::string at, const MatrixFleet& fleet, Fields& outer) {
  RobotRow row;
  if (value.is_string()) {
    row.robot_id = value.get<std::string>();
  } else {
    Fields fields(value, std::move(at));
    row.robot_id = fields.text("robot_id", max_id_bytes);
    if (const json* pose = fields.member("pose")) {
      Fields own(*pose, fields.pointer("pose"));
      row.pose = {own.number("x_m", place), own.number("y_m", place),
                  own.number("heading_rad", {.minimum = -1e3, .maximum = 1e3}, 0)};
      finish(own, fields);
    }
    row.state_of_charge = fields.optional_number("state_of_charge", fraction);
    finish(fields, outer);
  }
  if (!outer.ok()) return row;
  auto model = fleet.model(row.robot_id);
  if (!model) {
    row.problem = model.error().message;
    return row;
  }
  row.model = std::move(*model);
  if (!row.pose) row.pose = fleet.pose(row.robot_id);
  return row;
}

struct TaskColumn {
  std::string task_id;
  planning::MatrixTask task;
};

TaskColumn read_task(const json& value, std::string at, std::size_t robots, Fields& outer) {
  Fields fields(value, std::move(at));
  TaskColumn column;
  planning::MatrixTask& task = column.task;
  column.task_id = fields.text("task_id", max_id_bytes);
  task.payload_kg = fields.number("payload_kg", {.minimum = 0, .maximum = 1e5}, 0);
  task.pickup = read_station(fields, "pickup");
  task.dropoff = read_station(fields, "dropoff");
  if (const json* empty = fields.member("empty")) {
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
  if (const json* loaded = fields.member("loaded"))
    task.loaded = read_leg(*loaded, fields.pointer("loaded"), fields);
  task.pickup_dwell_s = fields.number("pickup_dwell_s", dwell, 0);
  task.dropoff_dwell_s = fields.number("dropoff_dwell_s", dwell, 0);
  if (task.empty.empty() && !task.pickup) fields.fault("pickup", "is required where \"empty\" is not given");
  if (!task.loaded && (!task.pickup || !task.dropoff))
    fields.fault(task.pickup ? "dropoff" : "pickup", "is required where \"loaded\" is not given");
  if (fields.ok() && !task.loaded &&
      std::hypot(task.dropoff->x_m - task.pickup->x_m, task.dropoff->y_m - task.pickup->y_m) >
          planning::longest_leg_m)
    fields.fault("dropoff", fmt::format("is farther than {} m from the pick-up", planning::longest_leg_m));
  finish(fields, outer);
  return column;
}

// Runs `work(k)` for k in [0, count) on this thread and one more.
template <class Work>
void on_two_threads(std::size_t count, Work&& work) {
  if (count < 2 || std::thread::hardware_concurrency() < 2) {
    for (std::size_t k = 0; k < count; ++k) work(k);
    return;
  }
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t k = next++; k < count; k = next++) work(k);
  };
  std::jthread other(run);
  run();
}

}  // namespace

struct MatrixAnswer::State {
  std::vector<RobotRow> robots;
  std::vector<TaskColumn> columns;
  std::vector<double> payload_kg;  // of the columns
  planning::CostOptions options;
  planning::CostTableCache* cache = nullptr;

  // Tables still to be had, one for each different model; then the matrix.
  std::vector<const server::ModelInForce*> models;
  std::vector<Result<std::shared_ptr<const CostTable>>> tables;
  std::size_t tables_done = 0;
  std::unique_ptr<planning::CostMatrix> matrix;
  std::size_t rows_done = 0;

  void collect_tables();
  void assemble();
  void write_row(std::size_t robot, JsonWriter& json) const;
  std::string detail_of(Obstacle obstacle, std::size_t robot) const;
  // That the robot ends each task with its reserve, driving by minimum-energy profiles.
  void write_success(const RobotRow& robot, const std::vector<Cell>& cells, std::vector<double>& numbers,
                     JsonWriter& json) const;
};

void MatrixAnswer::State::collect_tables() {
  const auto until = std::chrono::steady_clock::now() + tables_piece;
  std::atomic<std::size_t> next = tables_done;
  on_two_threads(2, [&](std::size_t) {
    do {
      const std::size_t k = next++;
      if (k >= models.size()) return;
      tables[k] = cache->get(models[k]->robot, options);
    } while (std::chrono::steady_clock::now() < until);
  });
  tables_done = std::min(next.load(), models.size());
}

void MatrixAnswer::State::assemble() {
  std::unordered_map<const server::ModelInForce*, std::size_t> table_of;
  for (std::size_t k = 0; k < models.size(); ++k) table_of.emplace(models[k], k);
  std::vector<planning::MatrixRobot> rows;
  rows.reserve(robots.size());
  for (const RobotRow& robot : robots) {
    if (robot.model == nullptr) {
      rows.emplace_back();
      continue;
    }
    rows.push_back(
        {*tables[table_of.at(robot.model.get())], robot.model->robot.limits.payload_kg, robot.pose});
  }
  std::vector<planning::MatrixTask> tasks;
  tasks.reserve(columns.size());
  for (const TaskColumn& column : columns) payload_kg.push_back(column.task.payload_kg);
  for (TaskColumn& column : columns) tasks.push_back(std::move(column.task));
  matrix = std::make_unique<planning::CostMatrix>(std::move(rows), std::move(tasks));
}

void MatrixAnswer::State::write_success(const RobotRow& robot, const std::vector<Cell>& cells,
                                        std::vector<double>& numbers, JsonWriter& json) const {
  const auto possible = std::ranges::find_if(cells, [](const Cell& c) { return c.duration_s > 0; });
  if (robot.outlook.forecaster == nullptr || !std::isfinite(robot.charge.fraction)) {
    json.key("success_probability").null();
    return;
  }
  const double standing_w = robot.model->drive.battery_power_for({0, 0});
  const double power_w = possible != cells.end() ? possible->energy_j / possible->duration_s : standing_w;
  const forecast::QuickSuccess success(*robot.outlook.forecaster, *robot.outlook.battery, robot.charge,
                                       standing_w, power_w);
  for (std::size_t t = 0; t < cells.size(); ++t) {
    const Cell& cell = cells[t];
    numbers[t] = std::isfinite(cell.energy_j)
                     ? success.probability(cell.energy_j, cell.duration_s, cell.loaded.energy_j,
                                           cell.loaded.duration_s, payload_kg[t])
                     : cell.energy_j;
  }
  constexpr int probability_places = 4;
  json.column("success_probability", numbers, probability_places);
}

std::string MatrixAnswer::State::detail_of(Obstacle obstacle, std::size_t r) const {
  const planning::MatrixRobot& robot = matrix->robot(r);
  switch (obstacle) {
    case Obstacle::none:
      break;
    case Obstacle::payload:
      return fmt::format("this robot carries at most {} kg", robot.payload_limit_kg);
    case Obstacle::limits:
      return robot.table->obstacle() ? describe(*robot.table->obstacle())
                                     : std::string("no motion within the limits");
    case Obstacle::pose:
      return "the robot reports no pose; give it in the request, or the way to the pick-up";
    case Obstacle::model:
      return robots[r].problem;
  }
  return {};
}

void MatrixAnswer::State::write_row(std::size_t r, JsonWriter& json) const {
  const planning::MatrixRobot& robot = matrix->robot(r);
  std::vector<Cell> cells;
  matrix->row(r, cells);
  std::vector<double> numbers(cells.size());
  json.begin_object();
  const bool known = robot.table != nullptr;
  json.field("robot_id", robots[r].robot_id).key("model_version");
  known ? json.value(robots[r].model->version) : json.null();
  json.key("interpolation_error");
  known ? json.value(robot.table->interpolation_error()) : json.null();
  json.key("neglected_effects").begin_array();
  if (known)
    for (const std::string& id : robot.table->neglected()) json.value(id);
  json.end_array();
  for (std::size_t t = 0; t < cells.size(); ++t) numbers[t] = cells[t].energy_j;
  json.column("energy_j", numbers, places);
  for (std::size_t t = 0; t < cells.size(); ++t) numbers[t] = cells[t].duration_s;
  json.column("duration_s", numbers, places);
  write_success(robots[r], cells, numbers, json);
  json.key("infeasible").begin_array();
  for (const Obstacle obstacle : {Obstacle::model, Obstacle::pose, Obstacle::payload, Obstacle::limits}) {
    const auto is = [&](const Cell& cell) { return cell.obstacle == obstacle; };
    if (std::none_of(cells.begin(), cells.end(), is)) continue;
    json.begin_object().field("reason", planning::name_of(obstacle));
    json.field("detail", detail_of(obstacle, r));
    json.key("tasks").begin_array();
    for (std::size_t t = 0; t < cells.size(); ++t)
      if (is(cells[t])) json.value(static_cast<std::int64_t>(t));
    json.end_array().end_object();
  }
  json.end_array().end_object();
}

MatrixAnswer::MatrixAnswer(std::unique_ptr<State> state) : state_(std::move(state)) {}
MatrixAnswer::~MatrixAnswer() = default;

Result<std::shared_ptr<MatrixAnswer>> MatrixAnswer::make(const json& request, const MatrixFleet& fleet,
                                                         planning::CostTableCache& tables) {
  Fields fields(request);
  auto state = std::make_unique<State>();
  state->cache = &tables;
  state->options.value_of_time_w = fields.number("value_of_time_w", {.minimum = 0, .maximum = 1e6}, 0);
  state->options.regeneration = fields.optional_number("regeneration", fraction);
  const std::optional<double> reserve = fields.optional_number("reserve_fraction", fraction);
  const json* robots = read_array(fields, "robots", max_robots);
  const json* tasks = read_array(fields, "tasks", max_tasks);
  if (fields.ok() && robots->size() * tasks->size() > max_cells) {
    fields.fault({Fault::too_large, fields.pointer("tasks"),
                  fmt::format("{} robots by {} tasks are {} cells, at most {} are answered at once",
                              robots->size(), tasks->size(), robots->size() * tasks->size(), max_cells)});
  }
  for (std::size_t k = 0; fields.ok() && k < robots->size(); ++k)
    state->robots.push_back(read_robot((*robots)[k], fmt::format("/robots/{}", k), fleet, fields));
  for (std::size_t k = 0; fields.ok() && k < tasks->size(); ++k) {
    state->columns.push_back(read_task((*tasks)[k], fmt::format("/tasks/{}", k), robots->size(), fields));
  }
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  for (RobotRow& robot : state->robots) {
    if (!fleet.outlook || !fleet.charge) break;
    if (robot.model == nullptr) continue;
    robot.charge = fleet.charge(*robot.model, robot.state_of_charge, reserve);
    if (std::isfinite(robot.charge.fraction)) robot.outlook = fleet.outlook(robot.model);
  }
  std::unordered_map<const server::ModelInForce*, bool> seen;
  for (const RobotRow& robot : state->robots)
    if (robot.model != nullptr && seen.emplace(robot.model.get(), true).second)
      state->models.push_back(robot.model.get());
  state->tables.assign(state->models.size(), std::shared_ptr<const CostTable>());
  return std::shared_ptr<MatrixAnswer>(new MatrixAnswer(std::move(state)));
}

bool MatrixAnswer::next(std::string& out, const std::stop_token& left) {
  State& s = *state_;
  if (left.stop_requested()) return false;
  if (s.tables_done < s.models.size()) {
    s.collect_tables();
    return true;
  }
  JsonWriter head;
  if (!s.matrix) {
    // Every model in force and every option has been checked, so that a table not to be had is our bug; the
    // stream breaks rather than end as if it were whole.
    for (const auto& table : s.tables)
      if (!table) throw std::logic_error(describe(table.error()));
    s.assemble();
    head.begin_object().field("value_of_time_w", s.options.value_of_time_w);
    head.key("tasks").begin_array();
    for (const TaskColumn& column : s.columns) head.value(column.task_id);
    head.end_array();
    out += head.text();
    out += ",\"rows\":[";
  }
  const std::size_t count = std::min(rows_per_piece, s.robots.size() - s.rows_done);
  std::array<JsonWriter, rows_per_piece> rows;
  on_two_threads(count, [&](std::size_t k) {
    if (!left.stop_requested()) s.write_row(s.rows_done + k, rows[k]);
  });
  if (left.stop_requested()) return false;
  for (std::size_t k = 0; k < count; ++k) {
    if (s.rows_done + k > 0) out += ',';
    out += rows[k].text();
  }
  s.rows_done += count;
  if (s.rows_done < s.robots.size()) return true;
  out += "]}";
  return false;
}

std::vector<TableRow> matrix_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = http::Method::post,
        .path = "/v1/energy-matrix",
        .operation_id = "computeEnergyMatrix",
        .summary = "Energy and duration of every robot doing every task, row by row",
        .request_schema = "energy-matrix-request",
        .response_schema = "energy-matrix",
        .error_statuses = {413, 422},
        .run = http::Run::compute},
       answered_by([](Services& services, const http::Request& r) -> Result<http::Response> {
         MatrixFleet fleet;
         fleet.model = [&services](const std::string& id) { return model_of(services, id); };
         fleet.pose = [&services](const std::string& id) -> std::optional<planning::Pose> {
           const auto live = services.fleet.find(id);
           if (!live || !std::isfinite(live->sample.pose[0] + live->sample.pose[1] + live->sample.pose[2]))
             return std::nullopt;
           return planning::Pose{live->sample.pose[0], live->sample.pose[1], live->sample.pose[2]};
         };
         fleet.outlook = [&services](const std::shared_ptr<const server::ModelInForce>& model) {
           return services.forecasts.of(model);
         };
         fleet.charge = [&services](const server::ModelInForce& model, const std::optional<double>& given,
                                    const std::optional<double>& reserve) {
           const auto live = services.fleet.find(model.robot.robot_id);
           return charge_of(given, {}, reserve, model.robot.battery, live.get())
               .value_or(forecast::Charge{signals::unmeasured, 0, 0});
         };
         auto answer = MatrixAnswer::make(*r.json, fleet, services.cost_tables);
         if (!answer) return tl::unexpected(std::move(answer.error()));
         http::Response response;
         response.stream = http::generate([answer = *answer](std::string& out, const std::stop_token& left) {
           return answer->next(out, left);
         });
         return response;
       })});
  return rows;
}

}  // namespace joulecast::api
