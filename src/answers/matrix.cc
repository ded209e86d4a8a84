#include "answers/matrix.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "answers/autonomy.h"
#include "base/parallel.h"
#include "forecast/outlook.h"

namespace joulecast::answers {
namespace {

using forecast::Motion;
using planning::Cell;
using planning::CostTable;
using planning::Obstacle;

constexpr std::size_t threads = 2;
constexpr double confidence = 0.95;  // of a task list's reserve in autonomy, by default

// The least charge, in hundredths, whose probability suffices; NaN where none does. `probability` rises with
// the charge.
template <class Probability>
double charge_that_suffices(Probability&& probability) {
  int low = 0, high = 101;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (probability(0.01 * middle) >= confidence ? high : low) = middle;
  }
  return high > 100 ? std::nan("") : 0.01 * high;
}

forecast::PlannedLeg leg_of(const planning::Stretch& stretch, double payload_kg) {
  using Kind = planning::Stretch::Kind;
  const double payload = stretch.loaded ? payload_kg : 0;
  if (stretch.kind == Kind::stand) return {Motion::stand, 0, 0, payload, stretch.amount};
  if (stretch.kind != Kind::other)
    return {stretch.kind == Kind::turn ? Motion::turn : Motion::drive, stretch.amount, 0, payload, 0};
  forecast::PlannedLeg leg = forecast::planned_leg(stretch.run);
  leg.payload_kg = payload;
  return leg;
}

}  // namespace

struct Matrix::State {
  struct Robot {
    std::shared_ptr<const ModelInForce> model;  // null: see `problem`
    std::string problem;
    std::optional<planning::Pose> pose;
    std::optional<forecast::Charge> charge;
    double to_full_s = std::nan("");  // at the charger
    RobotOutlook outlook;             // where the charge is available or usual driving is requested
  };

  MatrixInput input;
  std::vector<Robot> robots;
  planning::CostTableCache& cache;

  // Of minimum-energy driving: tables, one for each different model, then the matrix.
  std::vector<const ModelInForce*> models = {};
  std::vector<Result<std::shared_ptr<const CostTable>>> tables = {};
  std::size_t tables_done = 0;
  std::unique_ptr<planning::CostMatrix> matrix = {};

  Robot robot_of(const MatrixInput::Robot& given, const MatrixFleet& fleet) const;
  void assemble();
  std::vector<Cell> usual_cells(std::size_t r, MatrixRow& out, std::optional<Error>& obstacle) const;
  void state_success(const Robot& robot, const std::vector<Cell>& cells, MatrixRow& out) const;
  static void state_availability(const Robot& robot, MatrixRow& out);
  std::string detail_of(Obstacle obstacle, std::size_t r, const std::optional<Error>& limits) const;
};

Matrix::State::Robot Matrix::State::robot_of(const MatrixInput::Robot& given,
                                             const MatrixFleet& fleet) const {
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
          charge_of(given.state_of_charge, {}, input.reserve_fraction, robot.model->robot.battery, now))
    robot.charge = *charge;
  if (!given.state_of_charge && battery::at_charger(now.charging)) robot.to_full_s = now.to_full.duration_s;
  if (robot.charge || input.driving == Driving::usual) robot.outlook = fleet.outlook(robot.model);
  return robot;
}

void Matrix::State::assemble() {
  std::unordered_map<const ModelInForce*, std::size_t> table_of;
  for (std::size_t k = 0; k < models.size(); ++k) {
    // Every model in force and every option has been checked, so that a missing table is a bug.
    if (!tables[k]) throw std::logic_error(describe(tables[k].error()));
    table_of.emplace(models[k], k);
  }
  std::vector<planning::MatrixRobot> rows;
  rows.reserve(robots.size());
  for (const Robot& robot : robots) {
    if (robot.model == nullptr) {
      rows.emplace_back();
      continue;
    }
    rows.push_back(
        {*tables[table_of.at(robot.model.get())], robot.model->robot.limits.payload_kg, robot.pose});
  }
  matrix = std::make_unique<planning::CostMatrix>(std::move(rows), input.tasks);
}

// Priced at the robot's usual pace and corrected by its forecast; chances of the same forecasts. The reason
// why cells are beyond the motors is stored in `obstacle`.
std::vector<Cell> Matrix::State::usual_cells(std::size_t r, MatrixRow& out,
                                             std::optional<Error>& obstacle) const {
  const Robot& robot = robots[r];
  std::vector<Cell> cells(input.tasks.size());
  if (robot.model == nullptr) {
    for (Cell& cell : cells) cell.obstacle = Obstacle::model;
    return cells;
  }
  const forecast::Forecaster& forecaster = *robot.outlook.forecaster;
  const forecast::LegPricer pricer(robot.model->robot, robot.model->drive);
  std::vector<planning::Stretch> stretches;
  std::vector<forecast::PlannedLeg> legs;
  for (std::size_t t = 0; t < cells.size(); ++t) {
    const planning::MatrixTask& task = input.tasks[t];
    Cell& cell = cells[t];
    cell.obstacle = planning::obstacle_of(task, robot.model->robot.limits.payload_kg, robot.pose.has_value());
    if (cell.obstacle != Obstacle::none) continue;
    planning::stretches_of(task, r, robot.pose, stretches);
    legs.clear();
    for (const planning::Stretch& s : stretches)
      if (s.amount > 0) legs.push_back(leg_of(s, task.payload_kg));
    const bool halts_stated = task.stations.halts_stated() || forecast::states_halts(legs);
    const auto priced = forecast::price(forecaster, pricer, legs, {}, halts_stated);
    if (auto stuck = forecast::obstacle(pricer, legs, priced)) {
      cell.obstacle = Obstacle::limits;
      if (!obstacle) obstacle = std::move(stuck);
      continue;
    }
    const forecast::PlanSum sum = forecast::sum_of(forecaster, priced);
    cell.energy_j = forecaster.energy(sum).mean();
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
void Matrix::State::state_success(const Robot& robot, const std::vector<Cell>& cells, MatrixRow& out) const {
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
                               input.tasks[t].payload_kg);
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
void Matrix::State::state_availability(const Robot& robot, MatrixRow& out) {
  for (std::size_t t = 0; t < out.success_probability->size(); ++t) {
    const double now = robot.charge->fraction, needed = (*out.charge_needed)[t];
    if ((*out.success_probability)[t] >= confidence)
      (*out.available_in_s)[t] = 0;
    else if (needed > now)
      (*out.available_in_s)[t] = robot.to_full_s * (needed - now) / (1 - now);
  }
}

std::string Matrix::State::detail_of(Obstacle obstacle, std::size_t r,
                                     const std::optional<Error>& limits) const {
  switch (obstacle) {
    case Obstacle::none:
      break;
    case Obstacle::payload:
      return fmt::format("this robot carries at most {} kg", robots[r].model->robot.limits.payload_kg);
    case Obstacle::limits:
      return limits ? describe(*limits) : std::string("no motion within the limits");
    case Obstacle::pose:
      return "the robot reports no pose; state it in the request, or the way to the pick-up";
    case Obstacle::model:
      return robots[r].problem;
  }
  return {};
}

Matrix::Matrix(MatrixInput input, const MatrixFleet& fleet, planning::CostTableCache& tables)
    : state_(new State{.input = std::move(input), .robots = {}, .cache = tables}) {
  State& s = *state_;
  s.robots.reserve(s.input.robots.size());
  for (const MatrixInput::Robot& given : s.input.robots) s.robots.push_back(s.robot_of(given, fleet));
  if (s.input.driving == Driving::usual) return;
  std::unordered_map<const ModelInForce*, bool> seen;
  for (const State::Robot& robot : s.robots)
    if (robot.model != nullptr && seen.emplace(robot.model.get(), true).second)
      s.models.push_back(robot.model.get());
  s.tables.assign(s.models.size(), std::shared_ptr<const CostTable>());
}

Matrix::~Matrix() = default;
Matrix::Matrix(Matrix&&) noexcept = default;

const MatrixInput& Matrix::input() const {
  return state_->input;
}

bool Matrix::prepare(std::chrono::milliseconds time, const std::stop_token& stop) {
  State& s = *state_;
  if (s.tables_done == s.models.size()) {
    if (s.matrix == nullptr && s.input.driving == Driving::minimum_energy) s.assemble();
    return false;
  }
  const auto until = std::chrono::steady_clock::now() + time;
  std::atomic<std::size_t> next = s.tables_done;
  parallel_for(threads, threads, [&](std::size_t) {
    do {
      const std::size_t k = next++;
      if (k >= s.models.size()) return;
      s.tables[k] = s.cache.get(s.models[k]->robot, s.input.options, stop);
    } while (!stop.stop_requested() && std::chrono::steady_clock::now() < until);
  });
  s.tables_done = std::min(next.load(), s.models.size());
  return true;
}

MatrixRow Matrix::row(std::size_t r, const std::stop_token& stop) const {
  const State& s = *state_;
  const State::Robot& robot = s.robots[r];
  MatrixRow out;
  out.robot_id = s.input.robots[r].robot_id;
  out.siblings_pending = robot.outlook.siblings_pending;
  std::vector<Cell> cells;
  std::optional<Error> limits;  // that some cells break
  if (robot.charge)
    for (auto* column : {&out.success_probability, &out.charge_needed, &out.available_in_s})
      column->emplace(s.input.tasks.size(), std::nan(""));
  if (s.input.driving == Driving::usual) {
    cells = s.usual_cells(r, out, limits);
  } else {
    s.matrix->row(r, cells, stop);
    if (robot.charge) s.state_success(robot, cells, out);
  }
  if (robot.charge) State::state_availability(robot, out);
  if (robot.model != nullptr) {
    out.model_version = robot.model->version;
    const auto effects = *dynamics::active_effects(robot.model->robot);
    for (const dynamics::ActiveEffect& active : effects)
      if (active.effect->info().needs_position || active.effect->info().needs_heading)
        out.neglected_effects.emplace_back(active.effect->info().id);
    if (s.matrix != nullptr) {
      const CostTable& table = *s.matrix->robot(r).table;
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
      if (cells[t].obstacle == obstacle) task_ids.push_back(s.input.task_ids[t]);
    if (!task_ids.empty())
      out.infeasible.push_back({obstacle, s.detail_of(obstacle, r, limits), std::move(task_ids)});
  }
  return out;
}

}  // namespace joulecast::answers
