#include "planning/cost_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/drive_model.h"
#include "planning/planner.h"

namespace joulecast::planning {
namespace {

constexpr double shortest_leg_m = 1e-3;
constexpr double smallest_turn_rad = 1e-3;
// Tables are refined until their error is below this, or their nodes number the most.
constexpr double wanted_error = 2e-4;
constexpr std::size_t first_lengths_per_decade = 8, most_lengths_per_decade = 32;
constexpr std::size_t first_payloads = 5, most_payloads = 17;

// Weights of the cubic through four equally spaced points, `x` of a step beyond the second.
std::array<double, 4> cubic(double x) {
  const double a = x + 1, b = x - 1, c = x - 2;
  return {-x * b * c / 6, a * b * c / 2, -a * x * c / 2, a * x * b / 6};
}

}  // namespace

void CostTable::Grid::fill(const Solve& solve, std::size_t payloads, std::size_t lengths, CostTable& table) {
  payloads_ = payloads;
  lengths_ = lengths;
  nodes_.clear();
  nodes_.reserve(payloads * lengths);
  for (std::size_t p = 0; p < payloads; ++p) {
    const double payload =
        payloads > 1 ? payload_limit_kg_ * static_cast<double>(p) / static_cast<double>(payloads - 1) : 0;
    for (std::size_t k = 0; k < lengths; ++k) {
      const double length = std::exp(log_shortest_ + static_cast<double>(k) / per_log_);
      const auto cost = solve(length, payload);
      ++table.solves_;
      if (cost) {
        nodes_.push_back({cost->energy_j / length, cost->duration_s / length});
      } else {
        nodes_.push_back({std::nan(""), std::nan("")});
        if (!table.obstacle_) table.obstacle_ = cost.error();
      }
    }
  }
}

double CostTable::Grid::error_against(const Solve& solve, CostTable& table) const {
  double worst = 0;
  for (std::size_t p = 0; p + 1 < std::max<std::size_t>(payloads_, 2); ++p) {
    const double payload = payloads_ > 1 ? payload_limit_kg_ * (static_cast<double>(p) + 0.5) /
                                               static_cast<double>(payloads_ - 1)
                                         : 0;
    for (std::size_t k = 0; k + 1 < lengths_; ++k) {
      const double length = std::exp(log_shortest_ + (static_cast<double>(k) + 0.5) / per_log_);
      const auto exact = solve(length, payload);
      ++table.solves_;
      if (!exact) continue;
      const LegCost ours = at(length, payload);
      if (!std::isfinite(ours.energy_j)) continue;
      worst = std::max({worst, std::fabs(ours.energy_j / exact->energy_j - 1),
                        std::fabs(ours.duration_s / exact->duration_s - 1)});
    }
  }
  return worst;
}

void CostTable::Grid::build(const Solve& solve, double shortest, double longest, double payload_limit_kg,
                            CostTable& table) {
  shortest_ = shortest;
  log_shortest_ = std::log(shortest);
  payload_limit_kg_ = payload_limit_kg;
  const double range = std::log(longest / shortest);
  std::size_t payloads = payload_limit_kg > 0 ? first_payloads : 1;
  double error = 0;
  for (std::size_t per_decade = first_lengths_per_decade; per_decade <= most_lengths_per_decade;
       per_decade *= 2) {
    const auto lengths =
        static_cast<std::size_t>(std::ceil(range / std::log(10.0) * static_cast<double>(per_decade)) + 1);
    per_log_ = static_cast<double>(lengths - 1) / range;
    fill(solve, payloads, lengths, table);
    error = error_against(solve, table);
    if (error <= wanted_error) break;
    if (payloads > 1 && payloads < most_payloads) payloads = 2 * payloads - 1;
  }
  table.interpolation_error_ = std::max(table.interpolation_error_, error);
}

CostTable::Grid::Node CostTable::Grid::along(std::size_t payload, std::size_t first,
                                             const std::array<double, 4>& weight) const {
  const Node* node = &nodes_[payload * lengths_ + first];
  Node sum;
  for (std::size_t i = 0; i < 4; ++i) {
    sum.energy_per_length += weight[i] * node[i].energy_per_length;
    sum.duration_per_length += weight[i] * node[i].duration_per_length;
  }
  return sum;
}

LegCost CostTable::Grid::at(double length, double payload_kg) const {
  if (!(length > 0)) return {};
  // Below the first node distance and time are those of a motion without speed worth mentioning: as its root.
  const double scale = length < shortest_ ? std::sqrt(length * shortest_) : length;
  const double x = std::max(0.0, (std::log(length) - log_shortest_) * per_log_);
  const auto place = [](double at, std::size_t count) {
    const auto cell = std::min(static_cast<std::size_t>(at), count - 2);
    const std::size_t first = std::min(cell > 0 ? cell - 1 : 0, count - 4);
    return std::pair(first, cubic(at - static_cast<double>(first) - 1));
  };
  const auto [first, weight] = place(x, lengths_);
  Node node;
  if (payloads_ == 1 || payload_kg == 0) {
    node = along(0, first, weight);
  } else {
    const auto [row, share] =
        place(payload_kg / payload_limit_kg_ * static_cast<double>(payloads_ - 1), payloads_);
    for (std::size_t i = 0; i < 4; ++i) {
      const Node part = along(row + i, first, weight);
      node.energy_per_length += share[i] * part.energy_per_length;
      node.duration_per_length += share[i] * part.duration_per_length;
    }
  }
  return {node.energy_per_length * scale, node.duration_per_length * scale};
}

Result<CostTable> CostTable::make(const robot::RobotModel& robot, const CostOptions& options) {
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
  const auto solver = [&](int turn) {
    return [&planner, &problem, turn](double length, double payload_kg) -> Result<LegCost> {
      Path path;
      Run run;
      run.turn = turn;
      run.payload_kg = payload_kg;
      run.knots = {{0, 0, {}}, {length, 0, turn == 0 ? Pose{length, 0, 0} : Pose{0, 0, length}}};
      path.runs = {std::move(run)};
      path.final_payload_kg = payload_kg;
      const auto cost = planner->cost(path, problem);
      if (!cost) return tl::unexpected(cost.error());
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
