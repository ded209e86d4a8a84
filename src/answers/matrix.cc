#include "answers/matrix.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "answers/autonomy.h"
#include "base/parallel.h"
#include "forecast/outlook.h"

namespace joulecast::answers {
namespace {

using planning::Cell;
using planning::CostTable;
using planning::Obstacle;

constexpr std::size_t threads = 2;
constexpr double confidence = 0.95;  // of a task list's reserve in autonomy, by default

// The least charge, in hundredths, that suffices; NaN: none does. `probability` rises with the charge.
template <class Probability>
double charge_that_suffices(Probability&& probability) {
  int low = 0, high = 101;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (probability(0.01 * middle) >= confidence ? high : low) = middle;
  }
  return high > 100 ? std::nan("") : 0.01 * high;
}

using Json = nlohmann::json;

using described::Input;
using described::Presence;
using described::Table;
using planning::MatrixTask;
using Robot = MatrixInput::Robot;

constexpr described::Count robots_of_matrix{1, 10'000}, tasks_of_matrix{1, 10'000};
// Of minimum-energy and of usual driving, which takes ten times the work, 11 s of CPU for so many.
constexpr std::size_t max_cells = 4'000'000, max_usual_cells = 1'000'000;
constexpr std::size_t rows_per_piece = 16;
constexpr std::chrono::milliseconds tables_piece{20};  // most are there already, one to be built takes longer
constexpr std::size_t max_robot_id_bytes = 128, max_task_id_bytes = 200;
constexpr int places = 3;  // of energies and durations: millijoules and milliseconds
constexpr int probability_places = 4;

struct ReadLeg {
  Way way;
  planning::PathOptions options;
  planning::Leg leg;
};

void make_leg(Fields& fields, ReadLeg& read, PathContext&) {
  for (std::size_t k = 0; k < read.way.path.size() && fields.ok(); ++k)
    if (const auto* change = std::get_if<planning::PayloadChange>(&read.way.path[k]))
      if (change->payload_kg > 0)
        fields.fault(fmt::format("path/{}/payload_kg", k),
                     "must be 0: the task's payload_kg is carried from the pick-up to the drop-off");
  if (!fields.ok() || read.way.path.empty()) return;
  Result<planning::Path> path = path_of(read.way, read.options);
  if (path) {
    read.leg = planning::leg_of(*path);
  } else {
    path.error().field = fields.pointer(path.error().field.substr(1));
    fields.fault(std::move(path.error()));
  }
}

const auto leg_input = Input<ReadLeg, PathContext>("A route; empty: none to drive")
                           .named("leg")
                           .object("start_pose", AT(options.start),
                                   "where a path with places on the map begins; default: the origin",
                                   pose_input(), Presence::optional)
                           .include(route_input(), &ReadLeg::way)
                           .include(former_way_input(), &ReadLeg::way)
                           .check(make_leg);

const auto robot_pose_input =
    Input<planning::Pose>()
        .include(point_input<planning::Pose>("place on the map"), std::identity())
        .number("heading_rad", &planning::Pose::heading_rad, heading_bounds_rad, heading_words, 0);
const auto robot_input =
    Input<Robot>()
        .text("robot_id", &Robot::robot_id, max_robot_id_bytes, "the robot of this row")
        .object("pose", &Robot::pose, "start of the robot; default: its last reported pose", robot_pose_input)
        .number("state_of_charge", &Robot::state_of_charge, fraction,
                "state of charge; default: the live one");

// A column of the request, for so many robots.
struct ReadTask {
  std::string task_id;
  MatrixTask task;
  bool former = false;
};
struct MatrixContext : PathContext {
  std::size_t robots = 0;
};

void read_empty(Fields& fields, ReadTask& read, MatrixContext& context) {
  const Json* empty = fields.member("empty");
  if (empty == nullptr) return;
  const auto add = [&](const Json& leg, std::string at) {
    ReadLeg one;
    leg_input.nested(leg, std::move(at), one, context, fields);
    read.task.empty.push_back(std::move(one.leg));
    read.former = read.former || one.way.former;
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
  const auto& [pickup, dropoff, pickup_dwell_s, dropoff_dwell_s] = task.stations;
  if (task.empty.empty() && !pickup) fields.fault("pickup", "is required where \"empty\" is not given");
  if (!task.loaded && (!pickup || !dropoff))
    fields.fault(pickup ? "dropoff" : "pickup", "is required where \"loaded\" is not given");
  if (fields.ok() && !task.loaded &&
      std::hypot(dropoff->x_m - pickup->x_m, dropoff->y_m - pickup->y_m) > planning::longest_leg_m)
    fields.fault("dropoff", fmt::format("is farther than {} m from the pick-up", planning::longest_leg_m));
}

const auto matrix_task_input =
    Input<ReadTask, MatrixContext>()
        .text("task_id", &ReadTask::task_id, max_task_id_bytes, "the caller's name of the task")
        .number("payload_kg", AT(task.payload_kg), {.minimum = 0, .maximum = 1e5},
                "carried from the pick-up to the drop-off", 0)
        .include(stations_input(), AT(task.stations))
        .custom("empty", {{"oneOf", {leg_input.of_member(), described::of_array(leg_input.of_member())}}},
                "route to the pick-up, common to all robots or one for each in order; replaces a turn "
                "towards it and a straight line",
                read_empty)
        .object(
            "loaded",
            [](ReadTask& read, ReadLeg&& leg) {
              read.task.loaded = std::move(leg.leg);
              read.former = read.former || leg.way.former;
            },
            "route from the pick-up to the drop-off, in place of a turn and a straight line", leg_input,
            Presence::optional)
        .check(check_stations);

// Checked before any robot and task is read.
void check_size(Fields& fields, MatrixInput& input, MatrixContext& context) {
  if (input.driving == Driving::usual) refuse_beside_usual(fields, {"value_of_time_w", "regeneration"});
  const Json* robots = described::read_array(fields, "robots", robots_of_matrix, Presence::required);
  const Json* tasks = described::read_array(fields, "tasks", tasks_of_matrix, Presence::required);
  if (!fields.ok()) return;
  context.robots = robots->size();
  const bool usual = input.driving == Driving::usual;
  const std::size_t cells = robots->size() * tasks->size(), most = usual ? max_usual_cells : max_cells;
  if (cells > most)
    fields.fault({Fault::too_large, fields.pointer("tasks"),
                  fmt::format("{} robots by {} tasks are {} cells, at most {} are allowed{}", robots->size(),
                              tasks->size(), cells, most, usual ? " of usual driving" : "")});
}

const auto infeasible_table =
    Table<MatrixRow::Infeasible>()
        .word(
            "reason", [](const MatrixRow::Infeasible& why) { return name_of(why.reason); },
            std::array{name_of(Obstacle::model), name_of(Obstacle::pose), name_of(Obstacle::payload),
                       name_of(Obstacle::limits)},
            "model: the robot is unknown or has no model; pose: its position is unknown and the task does "
            "not contain the route to its pick-up; payload: above its maximum payload; limits: no motion "
            "within its limits with this payload")
        .value("detail", AT(detail), "the same in a sentence")
        .texts("task_ids", AT(task_ids), "ids of the tasks, in the order of the request");
const auto row_table =
    Table<MatrixRow>()
        .value("robot_id", AT(robot_id), "the robot of this row")
        .value("model_version", AT(model_version), "null where the robot has no model")
        .value("interpolation_error", AT(interpolation_error),
               "largest relative error of the interpolated costs compared with the planner's; null for "
               "usual driving, which is computed leg by leg")
        .texts("neglected_effects", AT(neglected_effects),
               "adopted effects that depend on the position on the floor, which are not included in these "
               "costs")
        .column(
            "energy_j", AT(energy_j),
            "energy from the battery, dwells included; for usual driving the mean, the sum over the legs; "
            "null where infeasible",
            places, true)
        .column("duration_s", AT(duration_s), "duration of each task; null: infeasible", places, true)
        .column("success_probability", AT(success_probability),
                "probability that the robot ends this task alone, in the requested driving model, with at "
                "least its reserve; null where infeasible, and for all tasks of a robot of unknown charge",
                probability_places, true)
        .column("charge_needed", AT(charge_needed),
                "where the charge is too low for this task alone: the least charge, in steps of 0.01, with "
                "which it ends with the reserve with a probability of 95 %; null where the charge "
                "suffices, where a full one does not, and where infeasible",
                probability_places, true)
        .column("available_in_s", AT(available_in_s),
                "time at its charger until the robot has that charge, if charge arrives evenly until the "
                "charger's end, which is at most too long; 0 where the charge suffices; null where it is "
                "not known: not at a charger, or a given charge",
                places, true)
        .value("siblings_pending", AT(siblings_pending),
               "of forecasts while a started daemon still reads missions of its siblings", {{"const", true}})
        .only(AT(siblings_pending))
        .list("infeasible", AT(infeasible), "infeasible tasks of this robot, by reason", infeasible_table);

// Without the rows.
const auto head_table =
    Table<MatrixInput>()
        .word("driving", AT(driving), driving_names, "as requested, or the default")
        .value("value_of_time_w", AT(options.value_of_time_w), "requested value of time")
        .texts("task_ids", AT(task_ids), "ids in the order of the columns")
        .texts("tasks", AT(task_ids), "task_ids by its former name", {{"deprecated", true}});

const auto matrix_input =
    Input<MatrixInput, MatrixContext>(
        "Robots and tasks for a cost matrix; at most 4,000,000 pairs, 1,000,000 of usual driving")
        .choice("driving", &MatrixInput::driving, driving_names,
                "driving model. minimum_energy: minimum-energy motions from stop to stop, equal for equal "
                "robots and independent of their history; usual: each robot's own pace and the consumption "
                "estimated from its missions, for fleets that do not drive the planner's profiles. "
                "value_of_time_w and regeneration are valid only with minimum_energy",
                static_cast<std::size_t>(Driving::minimum_energy))
        .number("value_of_time_w", AT(options.value_of_time_w), value_of_time_bounds_w,
                "value of time, added to the energy", 0)
        .number("regeneration", AT(options.regeneration), fraction,
                "recovered share of braking power; replaces that of each robot file")
        .number("reserve_fraction", &MatrixInput::reserve_fraction, fraction,
                "charge to be left after a task, for its success probability; default the robot file's")
        .check(check_size)
        .list(
            "robots", &MatrixInput::robots, robots_of_matrix,
            "the rows: ids of robots, or robots with a pose and a charge",
            described::OrText(&Robot::robot_id, "robot id; the start is its last reported pose", robot_input))
        .list(
            "tasks",
            [](MatrixInput& matrix, ReadTask&& read) {
              matrix.task_ids.push_back(std::move(read.task_id));
              matrix.tasks.push_back(std::move(read.task));
              matrix.former = matrix.former || read.former;
            },
            tasks_of_matrix, "the columns", matrix_task_input);

}  // namespace

Matrix::Robot Matrix::robot_of(const MatrixInput::Robot& given, const MatrixFleet& fleet) const {
  Robot robot;
  auto model = fleet.model(given.robot_id);
  if (!model) {
    robot.problem = model.error().message;
    return robot;
  }
  robot.model = std::move(*model);
  const LiveRobot now = fleet.live(given.robot_id);
  robot.pose = given.pose ? given.pose : now.pose;
  if (const auto charge =
          charge_of(given.state_of_charge, {}, input_.reserve_fraction, robot.model->robot.battery, now))
    robot.charge = *charge;
  if (!given.state_of_charge && battery::at_charger(now.charging)) robot.to_full_s = now.to_full.duration_s;
  if (robot.charge || input_.driving == Driving::usual) robot.outlook = fleet.outlook(robot.model);
  return robot;
}

void Matrix::assemble() {
  std::unordered_map<const ModelInForce*, std::size_t> table_of;
  for (std::size_t k = 0; k < models_.size(); ++k) {
    // Every model in force and every option has been checked, so that a missing table is a bug.
    if (!tables_[k]) throw std::logic_error(describe(tables_[k].error()));
    table_of.emplace(models_[k], k);
  }
  std::vector<planning::MatrixRobot> rows;
  rows.reserve(robots_.size());
  for (const Robot& robot : robots_) {
    if (robot.model == nullptr) {
      rows.emplace_back();
      continue;
    }
    rows.push_back(
        {*tables_[table_of.at(robot.model.get())], robot.model->robot.limits.payload_kg, robot.pose});
  }
  matrix_ = std::make_unique<planning::CostMatrix>(std::move(rows), input_.tasks);
}

// Priced at the robot's usual pace and corrected by its forecast; chances of the same forecasts. The reason
// why cells are beyond the motors is stored in `obstacle`.
std::vector<Cell> Matrix::usual_cells(std::size_t r, MatrixRow& out, std::optional<Error>& obstacle) const {
  const Robot& robot = robots_[r];
  std::vector<Cell> cells(input_.tasks.size());
  if (robot.model == nullptr) {
    for (Cell& cell : cells) cell.obstacle = Obstacle::model;
    return cells;
  }
  const forecast::Forecaster& forecaster = *robot.outlook.forecaster;
  const forecast::LegPricer pricer(robot.model->robot, robot.model->drive);
  for (std::size_t t = 0; t < cells.size(); ++t) {
    const planning::MatrixTask& task = input_.tasks[t];
    Cell& cell = cells[t];
    cell.obstacle = planning::obstacle_of(task, robot.model->robot.limits.payload_kg, robot.pose.has_value());
    if (cell.obstacle != Obstacle::none) continue;
    const auto legs = planning::legs_of(task, r, robot.pose);
    const bool halts_stated = task.stations.halts_stated() || forecast::states_halts(legs);
    const auto priced = forecast::price(forecaster, pricer, legs, {}, halts_stated);
    if (auto stuck = forecast::obstacle(pricer, legs, priced)) {
      cell.obstacle = Obstacle::limits;
      if (!obstacle) obstacle = std::move(stuck);
      continue;
    }
    const forecast::PlanSum sum = forecast::sum_of(forecaster, priced);
    cell.energy_j = forecaster.energy(sum).expected();
    cell.duration_s = forecaster.duration(sum).quantile(0.5);
    if (!robot.charge) continue;
    const auto probability = [&](double charge) {
      return forecast::probability_of_reserve(forecaster, *robot.outlook.battery,
                                              {charge, robot.charge->deviation, robot.charge->reserve}, sum);
    };
    (*out.success_probability)[t] = probability(robot.charge->fraction);
    if ((*out.success_probability)[t] < confidence)
      (*out.charge_needed)[t] = charge_that_suffices(probability);
  }
  return cells;
}

// The probability that a robot driving by minimum-energy profiles ends each task with its reserve, and the
// charge with which it does.
void Matrix::state_success(const Robot& robot, const std::vector<Cell>& cells, MatrixRow& out) const {
  const auto possible = std::ranges::find_if(cells, [](const Cell& c) { return c.duration_s > 0; });
  const double standing_w = robot.model->drive.battery_power_for({0, 0});
  const double power_w = possible != cells.end() ? possible->energy_j / possible->duration_s : standing_w;
  const auto with = [&](double charge) {
    return forecast::QuickSuccess(*robot.outlook.forecaster, *robot.outlook.battery,
                                  {charge, robot.charge->deviation, robot.charge->reserve}, standing_w,
                                  power_w);
  };
  const forecast::QuickSuccess now = with(robot.charge->fraction);
  std::map<double, forecast::QuickSuccess> others;
  for (std::size_t t = 0; t < cells.size(); ++t) {
    const Cell& cell = cells[t];
    if (!std::isfinite(cell.energy_j)) continue;
    const auto probability = [&](const forecast::QuickSuccess& quick) {
      return quick.probability(cell.energy_j, cell.duration_s, cell.loaded.energy_j, cell.loaded.duration_s,
                               input_.tasks[t].payload_kg);
    };
    (*out.success_probability)[t] = probability(now);
    if ((*out.success_probability)[t] >= confidence) continue;
    (*out.charge_needed)[t] = charge_that_suffices([&](double charge) {
      auto other = others.find(charge);
      if (other == others.end()) other = others.emplace(charge, with(charge)).first;
      return probability(other->second);
    });
  }
}

// A charger's current falls, if at all, towards its end: charge that arrived evenly is no earlier.
void Matrix::state_availability(const Robot& robot, MatrixRow& out) {
  for (std::size_t t = 0; t < out.success_probability->size(); ++t) {
    const double now = robot.charge->fraction, needed = (*out.charge_needed)[t];
    if ((*out.success_probability)[t] >= confidence)
      (*out.available_in_s)[t] = 0;
    else if (needed > now)
      (*out.available_in_s)[t] = robot.to_full_s * (needed - now) / (1 - now);
  }
}

std::string Matrix::detail_of(Obstacle obstacle, std::size_t r, const std::optional<Error>& limits) const {
  switch (obstacle) {
    case Obstacle::none:
      break;
    case Obstacle::payload:
      return fmt::format("this robot carries at most {} kg", robots_[r].model->robot.limits.payload_kg);
    case Obstacle::limits:
      return limits ? describe(*limits) : std::string("no motion within the limits");
    case Obstacle::pose:
      return "the robot reports no pose; state it in the request, or the way to the pick-up";
    case Obstacle::model:
      return robots_[r].problem;
  }
  return {};
}

Matrix::Matrix(MatrixInput input, const MatrixFleet& fleet, planning::CostTableCache& tables)
    : input_(std::move(input)), cache_(tables) {
  robots_.reserve(input_.robots.size());
  for (const MatrixInput::Robot& given : input_.robots) robots_.push_back(robot_of(given, fleet));
  if (input_.driving == Driving::usual) return;
  std::unordered_map<const ModelInForce*, bool> seen;
  for (const Robot& robot : robots_)
    if (robot.model != nullptr && seen.emplace(robot.model.get(), true).second)
      models_.push_back(robot.model.get());
  tables_.assign(models_.size(), std::shared_ptr<const CostTable>());
}

bool Matrix::prepare(std::chrono::milliseconds time, const std::stop_token& stop) {
  if (tables_done_ == models_.size()) {
    if (matrix_ == nullptr && input_.driving == Driving::minimum_energy) assemble();
    return false;
  }
  const auto until = std::chrono::steady_clock::now() + time;
  std::atomic<std::size_t> next = tables_done_;
  parallel_for(threads, threads, [&](std::size_t) {
    do {
      const std::size_t k = next++;
      if (k >= models_.size()) return;
      tables_[k] = cache_.get(models_[k]->robot, input_.options, stop);
    } while (!stop.stop_requested() && std::chrono::steady_clock::now() < until);
  });
  tables_done_ = std::min(next.load(), models_.size());
  return true;
}

MatrixRow Matrix::row(std::size_t r, const std::stop_token& stop) const {
  const Robot& robot = robots_[r];
  MatrixRow out;
  out.robot_id = input_.robots[r].robot_id;
  out.siblings_pending = robot.outlook.siblings_pending;
  std::vector<Cell> cells;
  std::optional<Error> limits;  // that some cells break
  if (robot.charge)
    for (auto* column : {&out.success_probability, &out.charge_needed, &out.available_in_s})
      column->emplace(input_.tasks.size(), std::nan(""));
  if (input_.driving == Driving::usual) {
    cells = usual_cells(r, out, limits);
  } else {
    matrix_->row(r, cells, stop);
    if (robot.charge) state_success(robot, cells, out);
  }
  if (robot.charge) state_availability(robot, out);
  if (robot.model != nullptr) {
    out.model_version = robot.model->version;
    const auto effects = *dynamics::active_effects(robot.model->robot);
    for (const dynamics::ActiveEffect& active : effects)
      if (active.effect->info().depends_on_place())
        out.neglected_effects.emplace_back(active.effect->info().id);
    if (matrix_ != nullptr) {
      const CostTable& table = *matrix_->robot(r).table;
      out.interpolation_error = table.interpolation_error();
      limits = table.obstacle();
    }
  }
  for (const Cell& cell : cells) {
    out.energy_j.push_back(cell.energy_j);
    out.duration_s.push_back(cell.duration_s);
  }
  for (const Obstacle obstacle : {Obstacle::model, Obstacle::pose, Obstacle::payload, Obstacle::limits}) {
    std::vector<std::string> task_ids;
    for (std::size_t t = 0; t < cells.size(); ++t)
      if (cells[t].obstacle == obstacle) task_ids.push_back(input_.task_ids[t]);
    if (!task_ids.empty())
      out.infeasible.push_back({obstacle, detail_of(obstacle, r, limits), std::move(task_ids)});
  }
  return out;
}

described::Schemas matrix_schemas() {
  static const auto answer = Table<MatrixInput>("Cost of every task with every robot")
                                 .include(head_table, std::identity())
                                 .list(
                                     "rows", [](const MatrixInput&) { return std::vector<MatrixRow>(); },
                                     "one row per robot, in the order of the request", row_table);
  return {{"energy-matrix-request", matrix_input.schema()},
          {"leg", leg_input.schema()},
          {"energy-matrix", answer.schema()}};
}

Result<MatrixInput> read_matrix(const Json& request) {
  MatrixContext context;
  context.may_stand = true;
  return matrix_input.read(request, {}, context);
}

bool MatrixText::next(std::string& out, const std::stop_token& left) {
  if (left.stop_requested()) return false;
  const bool more = matrix_.prepare(tables_piece, left);
  if (left.stop_requested()) return false;
  if (more) return true;
  const MatrixInput& input = matrix_.input();
  if (!begun_) {
    JsonWriter head;
    head_table.write_members(head.begin_object(), input);
    out += head.text();
    out += ",\"rows\":[";
    begun_ = true;
  }
  const std::size_t count = std::min(rows_per_piece, input.robots.size() - rows_done_);
  std::array<JsonWriter, rows_per_piece> rows;
  parallel_for(count, 2, [&](std::size_t k) {
    if (!left.stop_requested()) row_table.write(rows[k], matrix_.row(rows_done_ + k, left));
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
