#include "planning/cost_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamics/drive_model.h"
#include "planning/planner.h"
#include "planning/run_planner.h"

namespace joulecast::planning {
namespace {

constexpr double shortest_leg_m = 1e-3;
constexpr double smallest_turn_rad = 1e-3;
// Tables are refined until their error is below this, or their nodes number the most.
constexpr double wanted_error = 2e-4;
constexpr double wanted_of_numerical = 2e-3;  // whose solves cost two hundred times as much
constexpr double first_lengths_per_decade = 8, most_lengths_per_decade = 32;
constexpr std::size_t first_payloads = 5, most_payloads = 17;
// How closely cost must follow its line beyond the knee. The numerical solver's own noise is above the first.
constexpr double straightness = 1e-5, straightness_of_numerical = 4e-4;

// Weights of the cubic through four equally spaced points, `x` of a step beyond the second.
std::array<double, 4> cubic(double x) {
  const double a = x + 1, b = x - 1, c = x - 2;
  return {-x * b * c / 6, a * b * c / 2, -a * x * c / 2, a * x * b / 6};
}

// The first of the four nodes about a place among `count`, and their weights.
std::pair<std::size_t, std::array<double, 4>> place(double at, std::size_t count) {
  const auto cell = std::min(static_cast<std::size_t>(at), count - 2);
  const std::size_t first = std::min(cell > 0 ? cell - 1 : 0, count - 4);
  return {first, cubic(at - static_cast<double>(first) - 1)};
}

}  // namespace

double CostTable::Grid::payload_of(double row) const {
  return rows_.size() > 1 ? payload_limit_kg_ * row / static_cast<double>(rows_.size() - 1) : 0;
}

// Finds the knee: beyond it the cost follows the line through two long motions.
CostTable::Grid::Row CostTable::Grid::row(const Solve& solve, double payload_kg, double longest,
                                          CostTable& table) const {
  Row row;
  row.knee = longest;
  const auto far = solve(longest, payload_kg), near = solve(0.5 * longest, payload_kg);
  table.solves_ += 2;
  if (!far || !near) {
    if (!table.obstacle_) table.obstacle_ = far ? near.error() : far.error();
    row.at_knee = row.per_length = {std::nan(""), std::nan("")};
    return row;
  }
  row.per_length = {(far->energy_j - near->energy_j) / (0.5 * longest),
                    (far->duration_s - near->duration_s) / (0.5 * longest)};
  row.at_knee = *far;
  const auto on_line = [&](double length) {
    const auto cost = solve(length, payload_kg);
    ++table.solves_;
    if (!cost) return false;
    const double rest = longest - length, bound = table.numerical_ ? straightness_of_numerical : straightness;
    return std::fabs(far->energy_j - rest * row.per_length.energy_j - cost->energy_j) <=
               bound * cost->energy_j &&
           std::fabs(far->duration_s - rest * row.per_length.duration_s - cost->duration_s) <=
               bound * cost->duration_s;
  };
  double low = log_shortest_, high = std::log(0.25 * longest);
  if (!on_line(std::exp(high))) return row;
  while (high - low > 0.02) {
    const double middle = 0.5 * (low + high);
    (on_line(std::exp(middle)) ? high : low) = middle;
  }
  row.knee = std::exp(high);
  row.at_knee = *solve(row.knee, payload_kg);
  return row;
}

void CostTable::Grid::fill(const Solve& solve, Row& row, double payload_kg, std::size_t lengths,
                           CostTable& table) const {
  row.per_log = static_cast<double>(lengths - 1) / (std::log(row.knee) - log_shortest_);
  row.nodes.clear();
  for (std::size_t k = 0; k < lengths; ++k) {
    const double length = std::exp(log_shortest_ + static_cast<double>(k) / row.per_log);
    const auto cost = solve(length, payload_kg);
    ++table.solves_;
    if (!cost && !table.obstacle_) table.obstacle_ = cost.error();
    row.nodes.push_back(cost ? Node{cost->energy_j / length, cost->duration_s / length}
                             : Node{std::nan(""), std::nan("")});
  }
}

double CostTable::Grid::error_against(const Solve& solve, double longest, CostTable& table) const {
  double worst = 0;
  const auto compare = [&](double length, double payload) {
    const auto exact = solve(length, payload);
    ++table.solves_;
    const LegCost ours = at(length, payload);
    if (!exact || !std::isfinite(ours.energy_j)) return;
    worst = std::max({worst, std::fabs(ours.energy_j / exact->energy_j - 1),
                      std::fabs(ours.duration_s / exact->duration_s - 1)});
  };
  for (std::size_t p = 0; p + 1 < std::max<std::size_t>(rows_.size(), 2); ++p) {
    const double payload = payload_of(static_cast<double>(p) + 0.5);
    const Row& row = rows_[p];
    for (std::size_t k = 0; k + 1 < row.nodes.size(); ++k)
      compare(std::exp(log_shortest_ + (static_cast<double>(k) + 0.5) / row.per_log), payload);
    for (const double beyond : {1.1, 1.5, 4.0})
      if (beyond * row.knee < longest) compare(beyond * row.knee, payload);
  }
  return worst;
}

void CostTable::Grid::build(const Solve& solve, double shortest, double longest, double payload_limit_kg,
                            CostTable& table) {
  shortest_ = shortest;
  log_shortest_ = std::log(shortest);
  payload_limit_kg_ = payload_limit_kg;
  std::size_t payloads = payload_limit_kg > 0 ? first_payloads : 1;
  double error = 0;
  for (double per_decade = first_lengths_per_decade; per_decade <= most_lengths_per_decade; per_decade *= 2) {
    rows_.assign(payloads, Row());
    double decades = 0;
    for (std::size_t p = 0; p < payloads; ++p) {
      rows_[p] = row(solve, payload_of(static_cast<double>(p)), longest, table);
      decades = std::max(decades, std::log10(rows_[p].knee / shortest));
    }
    const auto lengths = static_cast<std::size_t>(std::max(4.0, std::ceil(decades * per_decade) + 1));
    for (std::size_t p = 0; p < payloads; ++p)
      fill(solve, rows_[p], payload_of(static_cast<double>(p)), lengths, table);
    error = error_against(solve, longest, table);
    if (error <= (table.numerical_ ? wanted_of_numerical : wanted_error)) break;
    if (payloads > 1 && payloads < most_payloads) payloads = 2 * payloads - 1;
  }
  table.interpolation_error_ = std::max(table.interpolation_error_, error);
}

LegCost CostTable::Grid::along(const Row& row, double length, double log_length) const {
  if (length >= row.knee) {
    const double more = length - row.knee;
    return {row.at_knee.energy_j + more * row.per_length.energy_j,
            row.at_knee.duration_s + more * row.per_length.duration_s};
  }
  const auto [first, weight] =
      place(std::max(0.0, (log_length - log_shortest_) * row.per_log), row.nodes.size());
  Node sum;
  for (std::size_t i = 0; i < 4; ++i) {
    sum.energy_per_length += weight[i] * row.nodes[first + i].energy_per_length;
    sum.duration_per_length += weight[i] * row.nodes[first + i].duration_per_length;
  }
  // Below the first node distance and time are those of a motion without speed worth mentioning: as its root.
  const double scale = length < shortest_ ? std::sqrt(length * shortest_) : length;
  return {sum.energy_per_length * scale, sum.duration_per_length * scale};
}

LegCost CostTable::Grid::at(double length, double payload_kg) const {
  if (!(length > 0)) return {};
  const double log_length = std::log(length);
  if (rows_.size() == 1 || payload_kg == 0) return along(rows_[0], length, log_length);
  const auto [first, share] =
      place(payload_kg / payload_limit_kg_ * static_cast<double>(rows_.size() - 1), rows_.size());
  LegCost sum;
  for (std::size_t i = 0; i < 4; ++i) {
    const LegCost part = along(rows_[first + i], length, log_length);
    sum.energy_j += share[i] * part.energy_j;
    sum.duration_s += share[i] * part.duration_s;
  }
  return sum;
}

Result<CostTable> CostTable::make(const robot::RobotModel& robot, const CostOptions& options,
                                  std::stop_token stop) {
  const auto adopted = dynamics::active_effects(robot);
  if (!adopted) return tl::unexpected(adopted.error());
  CostTable table;
  robot::RobotModel placeless = robot;
  for (const dynamics::ActiveEffect& active : *adopted) {
    const dynamics::EffectInfo& info = active.effect->info();
    if (!info.needs_position && !info.needs_heading) continue;
    table.neglected_.emplace_back(info.id);
    std::erase_if(placeless.effects, [&](const robot::AdoptedEffect& e) { return e.id == info.id; });
  }
  const auto planner = Planner::make(placeless, options.regeneration);
  if (!planner) return tl::unexpected(planner.error());
  Problem problem;
  problem.limits = limits_of(placeless);
  problem.value_of_time_w = options.value_of_time_w;
  problem.intervals_per_run = 24;  // finer than what the table's own nodes tell
  const auto solver = [&](int turn) {
    const auto along = [turn](double length, double payload_kg) {
      Run run;
      run.turn = turn;
      run.payload_kg = payload_kg;
      run.knots = {{0, 0, {}}, {length, 0, turn == 0 ? Pose{length, 0, 0} : Pose{0, 0, length}}};
      return run;
    };
    // Loads depend on the payload alone: what closed forms need of them is kept for other lengths.
    auto last = std::make_shared<std::pair<Run, std::optional<RunPlanner>>>();
    return [&planner, &placeless, &problem, &table, &stop, along, last](
               double length, double payload_kg) -> Result<LegCost> {
      auto& [unit, closed] = *last;
      if (!closed || unit.payload_kg != payload_kg) {
        unit = along(1, payload_kg);
        auto made = RunPlanner::make(placeless, planner->loads(), unit, problem, 0, 0);
        closed = made ? std::optional(std::move(*made)) : std::nullopt;
      }
      if (closed && !stop.stop_requested()) {
        if (const auto answer = closed->closed_form(problem.value_of_time_w, length))
          return LegCost{answer->energy_j, answer->duration_s};
      }
      Path path;
      path.runs = {along(length, payload_kg)};
      path.final_payload_kg = payload_kg;
      const auto cost = planner->cost(path, problem, stop);
      if (!cost) return tl::unexpected(cost.error());
      table.numerical_ = true;
      return LegCost{cost->energy_j, cost->duration_s};
    };
  };
  const auto standing = dynamics::drive_model(placeless);
  if (!standing) return tl::unexpected(standing.error());
  table.idle_power_w_ = standing->battery_power_for({0, 0});
  const double payload_limit = std::max(0.0, robot.limits.payload_kg);
  Grid straight, turn;
  straight.build(solver(0), shortest_leg_m, longest_leg_m, payload_limit, table);
  turn.build(solver(1), smallest_turn_rad, widest_turn_rad, payload_limit, table);
  if (stop.stop_requested()) return stopped();
  table.straight_ = std::move(straight);
  table.turn_ = std::move(turn);
  return table;
}

LegCost CostTable::straight(double distance_m, double payload_kg) const {
  return straight_.at(distance_m, payload_kg);
}

LegCost CostTable::turn(double angle_rad, double payload_kg) const {
  return turn_.at(std::fabs(angle_rad), payload_kg);
}

}  // namespace joulecast::planning
