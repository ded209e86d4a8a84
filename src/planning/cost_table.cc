#include "planning/cost_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/try.h"
#include "dynamics/drive_model.h"
#include "planning/numerics.h"
#include "planning/planner.h"
#include "planning/run_planner.h"

namespace joulecast::planning {
namespace {

constexpr double shortest_leg_m = 1e-3;
constexpr double smallest_turn_rad = 1e-3;
// Tables are refined until their error is below this, or their nodes number the most.
constexpr double wanted_error = 2e-4;
constexpr double wanted_of_numerical = 2e-3;  // of nodes from the numerical solver
constexpr int rounds = 3;                     // of refinement; each doubles the nodes both ways
constexpr double first_per_decade = 10;
constexpr std::size_t first_payloads = 5;
// How closely cost must follow its line beyond the knee; the numerical solver's own noise is below it.
constexpr double straightness = 4e-4;
constexpr int payload_halvings = 6;  // that find the heaviest payload moved
constexpr LegCost no_motion{std::numeric_limits<double>::quiet_NaN(),
                            std::numeric_limits<double>::quiet_NaN()};

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

// The parts of a robot that the table depends on: limits_of reads the battery's voltage.
robot::RobotModel drive_of(const robot::RobotModel& robot) {
  robot::RobotModel drive = robot;
  drive.robot_id.clear();
  drive.battery = {};
  drive.battery.nominal_voltage_v = robot.battery.nominal_voltage_v;
  return drive;
}

}  // namespace

struct CostTable::Kind {
  const robot::RobotModel& robot;
  const Planner& planner;
  const Problem& problem;
  const std::stop_token& stop;
  int turn;
  double shortest, longest;
  bool numerical = false;  // the solver was required
  std::size_t solves = 0;

  Run run(double length) const {
    Run run;
    run.turn = turn;
    run.knots = {{0, 0, {}}, {length, 0, turn == 0 ? Pose{length, 0, 0} : Pose{0, 0, length}}};
    return run;
  }

  Result<Walk> walk(double payload_kg, double per_decade) {
    if (stop.stop_requested()) return stopped();
    if (!numerical) {
      Run unit = run(1);
      unit.payload_kg = payload_kg;
      TRY_ASSIGN(auto made, RunPlanner::make(robot, planner.loads(), unit,
                                             planner.loads().uniform_loads(unit), problem, 0, 0));
      if (const auto cruise = made.cruise_speed(problem.value_of_time_w))
        return along_family(made, *cruise, per_decade);
    }
    numerical = true;
    return by_solver(payload_kg, per_decade);
  }

 private:
  // From the slowest peak to nearly the cruising speed, in steps that change the length about evenly:
  // peak = cruise tanh(w), where the length grows as a power of w at first, and slower than w near the end.
  Walk along_family(RunPlanner& family, double cruise, double per_decade) {
    constexpr double last = 7.5;  // 1 - tanh is 6e-7
    const double step = std::numbers::ln10 / per_decade;
    Walk walk;
    const auto member = [&](double w) {
      const RestMotion m = *family.to_peak(cruise * std::tanh(w), problem.value_of_time_w);
      ++solves;
      return Member(m.distance, {m.energy_j, m.duration_s});
    };
    double w = last, power = 1.75;
    Member now = member(w);
    for (int k = 0; k < 60 && now.length > shortest; ++k)
      now = member(w *= std::clamp(0.9 * std::pow(shortest / now.length, 1 / power), 1e-3, 0.9));
    walk.members.push_back(now);
    while (w < last && now.length < longest) {
      const double next = std::min(last, w * std::exp(step / std::clamp(power, 0.25, 3.0)));
      const Member then = member(next);
      power = (then.log_length - now.log_length) / std::log(next / w);
      w = next, now = then;
      walk.members.push_back(now);
    }
    const double steady_w = family.steady_power_w(cruise);
    walk.per_length = {steady_w / cruise, 1 / cruise};
    return walk;
  }

  // Finds the knee: beyond it the cost follows the line through two long motions.
  Result<Walk> by_solver(double payload_kg, double per_decade) {
    const auto solve = [&](double length) -> Result<LegCost> {
      ++solves;
      TRY_ASSIGN(const auto cost, planner.cost(run(length), payload_kg, problem, stop));
      return LegCost{cost.energy_j, cost.duration_s};
    };
    const auto far = solve(longest), near = solve(0.5 * longest);
    if (!far || !near) return tl::unexpected(far ? near.error() : far.error());
    Walk walk;
    walk.per_length = {(far->energy_j - near->energy_j) / (0.5 * longest),
                       (far->duration_s - near->duration_s) / (0.5 * longest)};
    const auto on_line = [&](double log_length) {
      const double length = std::exp(log_length), rest = longest - length;
      const auto cost = solve(length);
      return cost &&
             std::fabs(far->energy_j - rest * walk.per_length.energy_j - cost->energy_j) <=
                 straightness * cost->energy_j &&
             std::fabs(far->duration_s - rest * walk.per_length.duration_s - cost->duration_s) <=
                 straightness * cost->duration_s;
    };
    double low = std::log(shortest), knee = std::log(longest);
    if (const double high = std::log(0.25 * longest); on_line(high)) {
      knee = high;
      while (knee - low > 0.02) {
        const double middle = 0.5 * (low + knee);
        (on_line(middle) ? knee : low) = middle;
      }
    }
    low = std::log(shortest);
    const double count = std::max(4.0, std::ceil((knee - low) / std::numbers::ln10 * per_decade) + 1);
    for (double k = 0; k < count; ++k) {
      const double length = std::exp(low + (knee - low) * k / (count - 1));
      TRY_ASSIGN(const auto cost, solve(length));
      walk.members.emplace_back(length, cost);
    }
    return walk;
  }
};

namespace {

// Costs of a unit of length: a cubic through the four members about a length, in its logarithm. `near` is
// where the last one was found.
template <class Members>
LegCost interpolated(const Members& members, double log_length, std::size_t& near) {
  while (near + 2 < members.size() && members[near + 1].log_length < log_length) ++near;
  const std::size_t first = std::min(near > 0 ? near - 1 : 0, members.size() - 4);
  LegCost sum;
  for (std::size_t i = first; i < first + 4; ++i) {
    double weight = 1 / members[i].length;
    for (std::size_t j = first; j < first + 4; ++j)
      if (j != i)
        weight *= (log_length - members[j].log_length) / (members[i].log_length - members[j].log_length);
    sum += weight * members[i].cost;
  }
  return sum;
}

}  // namespace

double CostTable::Grid::payload_of(double row) const {
  return rows_.size() > 1 ? payload_limit_kg_ * row / static_cast<double>(rows_.size() - 1) : 0;
}

CostTable::Row CostTable::Grid::row_of(const Walk& walk, double per_decade) const {
  Row row;
  std::vector<Member> members = walk.members;
  const auto beyond = [&](double length) {
    const Member& last = walk.members.back();
    Member m(length, last.cost);
    m.cost += (length - last.length) * walk.per_length;
    return m;
  };
  // A robot so slow that it cruises on the shortest way already.
  while (members.size() < 4 || members.back().length < 1.5 * shortest_)
    members.push_back(beyond(1.2 * std::max(members.back().length, shortest_)));
  row.knee = members.back().length, row.log_knee = members.back().log_length;
  row.at_knee = members.back().cost;
  row.per_length = walk.per_length;
  const double logs = std::log(row.knee) - log_shortest_;
  const double count = std::max(4.0, std::ceil(logs / std::numbers::ln10 * per_decade) + 1);
  row.per_log = (count - 1) / logs;
  std::size_t near = 0;
  for (double k = 0; k < count; ++k) {
    row.nodes.push_back(interpolated(members, log_shortest_ + k / row.per_log, near));
  }
  return row;
}

double CostTable::Grid::error_against(Kind& kind, double per_decade) const {
  double worst = 0;
  const auto compare = [&](double length, double payload_kg, const LegCost& exact) {
    const LegCost ours = at(length, payload_kg);
    if (length < shortest_ || length > kind.longest || !std::isfinite(ours.energy_j)) return;
    worst = std::max({worst, std::fabs(ours.energy_j / exact.energy_j - 1),
                      std::fabs(ours.duration_s / exact.duration_s - 1)});
  };
  for (std::size_t p = 0; p + 1 < std::max<std::size_t>(rows_.size(), 2); ++p) {
    const double payload_kg = payload_of(static_cast<double>(p) + 0.5);
    // Of another pace than the nodes', so that its members fall anywhere between them.
    const auto walk = kind.walk(payload_kg, 0.77 * per_decade);
    if (!walk) continue;
    for (const Member& m : walk->members) compare(m.length, payload_kg, m.cost);
    const Member& last = walk->members.back();
    for (const double beyond : {0.1, 0.5, 3.0}) {
      LegCost cost = last.cost;
      cost += beyond * last.length * walk->per_length;
      compare((1 + beyond) * last.length, payload_kg, cost);
    }
  }
  return worst;
}

// The heaviest payload that the motors can move; empty if they cannot move the robot alone.
std::optional<double> CostTable::Grid::heaviest(Kind& kind, double payload_limit_kg, CostTable& table) {
  const auto moves = [&](double payload_kg) {
    const auto walk = kind.walk(payload_kg, first_per_decade);
    if (!walk && !table.obstacle_) table.obstacle_ = walk.error();
    return walk.has_value();
  };
  if (moves(payload_limit_kg)) return payload_limit_kg;
  if (!moves(0)) return std::nullopt;
  return last_that(moves, 0, payload_limit_kg, payload_halvings);
}

void CostTable::Grid::build(Kind& kind, double payload_limit_kg, CostTable& table) {
  shortest_ = kind.shortest;
  log_shortest_ = std::log(shortest_);
  const auto most_kg = heaviest(kind, payload_limit_kg, table);
  if (!most_kg) return;
  payload_limit_kg_ = *most_kg;
  std::size_t payloads = *most_kg > 0 ? first_payloads : 1;
  double error = 0, per_decade = first_per_decade;
  for (int round = 0; round < rounds && !kind.stop.stop_requested(); ++round) {
    rows_.assign(payloads, Row());
    knees_within_ = true;
    for (std::size_t p = 0; p < payloads; ++p) {
      const auto walk = kind.walk(payload_of(static_cast<double>(p)), per_decade);
      if (walk) {
        rows_[p] = row_of(*walk, per_decade);
        knees_within_ = knees_within_ && rows_[p].knee < kind.longest && rows_[p].at_knee.energy_j > 0;
        continue;
      }
      if (!table.obstacle_) table.obstacle_ = walk.error();
      rows_[p].at_knee = rows_[p].per_length = no_motion;
    }
    error = error_against(kind, per_decade);
    if (error <= (kind.numerical ? wanted_of_numerical : wanted_error)) break;
    if (payloads > 1) payloads = 2 * payloads - 1;
    per_decade *= 2;
  }
  table.interpolation_error_ = std::max(table.interpolation_error_, error);
  table.solves_ += kind.solves;
}

LegCost CostTable::Grid::along(const Row& row, double length, double log_length) const {
  if (length >= row.knee) {
    LegCost cost = row.at_knee;
    return cost += (length - row.knee) * row.per_length;
  }
  const auto [first, weight] =
      place(std::max(0.0, (log_length - log_shortest_) * row.per_log), row.nodes.size());
  LegCost unit;
  for (std::size_t i = 0; i < 4; ++i) unit += weight[i] * row.nodes[first + i];
  // Below the first node distance and time are those of a motion without speed worth mentioning: as its root.
  return (length < shortest_ ? std::sqrt(length * shortest_) : length) * unit;
}

// Rows are interpolated at equal fractions of their knees, as fractions of the cost there. The knee is a kink
// that moves with the payload; in these fractions it stays in place.
LegCost CostTable::Grid::at(double length, double payload_kg) const {
  if (!(length > 0)) return {};
  if (rows_.empty() || payload_kg > payload_limit_kg_) return no_motion;
  const double log_length = std::log(length);
  if (rows_.size() == 1 || payload_kg == 0) return along(rows_[0], length, log_length);
  const auto [first, share] =
      place(payload_kg / payload_limit_kg_ * static_cast<double>(rows_.size() - 1), rows_.size());
  LegCost sum;
  if (!knees_within_) {
    for (std::size_t i = 0; i < 4; ++i) sum += share[i] * along(rows_[first + i], length, log_length);
    return sum;
  }
  double knee = 0;
  LegCost at_knee;
  for (std::size_t i = 0; i < 4; ++i) {
    knee += share[i] * rows_[first + i].knee;
    at_knee += share[i] * rows_[first + i].at_knee;
  }
  const double of_knee = length / knee;
  const double log_of_knee = std::log(of_knee);
  for (std::size_t i = 0; i < 4; ++i) {
    const Row& row = rows_[first + i];
    const LegCost part = along(row, of_knee * row.knee, log_of_knee + row.log_knee);
    sum.energy_j += share[i] * part.energy_j / row.at_knee.energy_j;
    sum.duration_s += share[i] * part.duration_s / row.at_knee.duration_s;
  }
  return {sum.energy_j * at_knee.energy_j, sum.duration_s * at_knee.duration_s};
}

Result<CostTable> CostTable::make(const robot::RobotModel& robot, const CostOptions& options,
                                  std::stop_token stop) {
  TRY_ASSIGN(const auto adopted, dynamics::active_effects(robot));
  CostTable table;
  robot::RobotModel placeless = robot;
  for (const dynamics::ActiveEffect& active : adopted) {
    const dynamics::EffectInfo& info = active.effect->info();
    if (!info.depends_on_place()) continue;
    table.neglected_.emplace_back(info.id);
    std::erase_if(placeless.effects, [&](const robot::AdoptedEffect& e) { return e.id == info.id; });
  }
  TRY_ASSIGN(auto made, Planner::make(placeless, options.regeneration));
  table.planner_ = std::make_shared<const Planner>(std::move(made));
  const Planner& planner = *table.planner_;
  table.problem_.limits = limits_of(placeless);
  table.problem_.value_of_time_w = options.value_of_time_w;
  Problem problem = table.problem_;
  problem.intervals_per_run = 24;  // finer than the resolution of the table's own nodes
  TRY_ASSIGN(const auto standing, dynamics::drive_model(placeless));
  table.idle_power_w_ = standing.battery_power_for({0, 0});
  const double payload_limit = std::max(0.0, robot.limits.payload_kg);
  Kind straights{placeless, planner, problem, stop, 0, shortest_leg_m, longest_leg_m};
  Kind turns{placeless, planner, problem, stop, 1, smallest_turn_rad, widest_turn_rad};
  table.straight_.build(straights, payload_limit, table);
  table.turn_.build(turns, payload_limit, table);
  if (stop.stop_requested()) return stopped();
  return table;
}

LegCost CostTable::straight(double distance_m, double payload_kg) const {
  return straight_.at(distance_m, payload_kg);
}

LegCost CostTable::solved(const Run& run, double payload_kg, const std::stop_token& stop) const {
  const auto cost = planner_->cost(run, payload_kg, problem_, stop);
  return cost ? LegCost{cost->energy_j, cost->duration_s} : no_motion;
}

LegCost CostTable::turn(double angle_rad, double payload_kg) const {
  return turn_.at(std::fabs(angle_rad), payload_kg);
}

std::shared_ptr<const CostTable> CostTableCache::find(const robot::RobotModel& robot,
                                                      const CostOptions& options) {
  const auto found = std::ranges::find_if(
      entries_, [&](const Entry& each) { return each.options == options && each.robot == robot; });
  if (found == entries_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found);
  return found->table;
}

Result<std::shared_ptr<const CostTable>> CostTableCache::get(const robot::RobotModel& robot,
                                                             const CostOptions& options,
                                                             std::stop_token stop) {
  robot::RobotModel drive = drive_of(robot);
  {
    const std::lock_guard lock(mutex_);
    if (auto table = find(drive, options)) return table;
  }
  TRY_ASSIGN(auto made, CostTable::make(drive, options, std::move(stop)));
  auto table = std::make_shared<const CostTable>(std::move(made));
  const std::lock_guard lock(mutex_);
  if (auto meanwhile = find(drive, options)) return meanwhile;
  entries_.push_front({std::move(drive), options, table});
  if (entries_.size() > capacity_) entries_.pop_back();
  return table;
}

std::size_t CostTableCache::size() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

}  // namespace joulecast::planning
