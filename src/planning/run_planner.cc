#include "planning/run_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/try.h"
#include "planning/numerics.h"

namespace joulecast::planning {
namespace {

constexpr std::size_t most_cells = 200'000;

// Relative to the cost: accuracy of the solution on a coarse and on a fine grid.
constexpr double coarse_tolerance = 1e-5, fine_tolerance = 1e-6;
// Relative to the cost, or to the shortest time: the greatest loss of the cells.
constexpr double lost_tolerance = 8e-5;
// The greatest number of refinements, and of cells relative to the first grid: not all losses fall with the
// size of cells.
constexpr int most_rounds = 3;
constexpr std::size_t most_growth = 16, most_uniform_growth = 64;
constexpr double at_limit = 1 - 1e-6;
constexpr double near_limits = 0.01;  // of motors, in the middle of a cell whose knots are looked at
constexpr double at_knots = std::numeric_limits<double>::infinity();  // parts of a cell: one for each knot

double sum_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// Upper bound on the time lost in each cell in which a profile changes from more acceleration to less, since
// it is defined at nodes only [s].
std::vector<double> lost_at_corners_s(const SpeedGrid& grid, const std::vector<double>& z) {
  std::vector<double> lost(grid.cells(), 0);
  const auto slope = [&](std::size_t k) { return (z[k + 1] - z[k]) / grid.step[k]; };
  for (std::size_t k = 1; k + 1 < grid.cells(); ++k) {
    const double h = grid.step[k], higher = std::max(0.0, slope(k - 1) - slope(k + 1)) * h / 4;
    lost[k] = 0.5 * higher * h / (2 * std::pow(mean_speed(z[k], z[k + 1]), 3));
  }
  return lost;
}

// Time that the fastest profile loses in each cell since motors are used fully at one of its ends only [s]:
// half of the difference, at the time that a change of the limit is worth there. It changes the far node's z
// and those that follow: onwards where limits hold the acceleration, backwards where they hold the braking.
std::vector<double> lost_at_ends_s(const SpeedGrid& grid, const std::vector<double>& z,
                                   const std::vector<MotorUse>& uses) {
  const std::size_t n = grid.cells();
  std::vector<double> worth_s(n + 1, 0), lost(n, 0);  // of a node's z
  for (std::size_t k = 0; k < n; ++k) {
    const double v0 = std::sqrt(z[k]), v1 = std::sqrt(z[k + 1]),
                 each = grid.step[k] / ((v0 + v1) * (v0 + v1));
    if (k > 0) worth_s[k] += each / v0;
    if (k + 1 < n) worth_s[k + 1] += each / v1;
  }
  for (const bool braking : {false, true}) {
    std::vector<double> worth = worth_s;
    const auto share = [&](const MotorUse& use) { return braking ? use.slowing : use.rising; };
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t k = braking ? i : n - 1 - i, far = braking ? k : k + 1, near = braking ? k + 1 : k;
      const double little = 1e-6 * std::max(z[k], z[k + 1]), here = share(uses[k]);
      if (here < at_limit) {
        if (z[far] - z[near] > at_limit * 2 * grid.step[k] * grid.acceleration_limit)
          worth[near] += worth[far];
        continue;
      }
      const double by_0 = share(motor_use(grid, k, z[k] + little, z[k + 1])) - here,
                   by_1 = share(motor_use(grid, k, z[k], z[k + 1] + little)) - here,
                   by_far = braking ? by_0 : by_1, by_near = braking ? by_1 : by_0;
      if (!(by_far > 0)) continue;
      lost[k] = uses[k].uneven * little / by_far * worth[far];
      worth[near] += std::max(0.0, -by_near / by_far) * worth[far];
    }
  }
  return lost;
}

std::string number(double x) {
  return std::to_string(x);
}

// Torque of a wheel at standstill that must overcome its friction.
double standing_torque_nm(const CellLoad& load) {
  const WheelLoad w = load.whole();
  return std::fabs(w.t0 + w.gear * std::fabs(w.t0) + w.f0 + w.stribeck);
}

// Power of a robot likewise [W].
double standing_power_w(const SpeedGrid& grid) {
  double sum = grid.electric.idle_w;
  for (const std::size_t s : {0u, 1u}) {
    const double torque = standing_torque_nm(grid.load(0)[s]);
    sum += grid.electric.copper_w_n2_m2[s] * torque * torque;
  }
  return sum;
}

}  // namespace

void RunAnswer::forget_motion() {
  line.reset();
  way = {}, speed = {};
}

tl::unexpected<Error> stopped() {
  return fail(Fault::stopped, "", "the answer is no longer wanted");
}

// The squared speed that speed, yaw rate and wheel speed limits allow, and which of them bounds it.
RunPlanner::Ceiling RunPlanner::ceiling(double way) const {
  const Limits& l = problem_->limits;
  const auto& p = loads_->model().parameters();
  const double turn = run_->turn == 0 ? std::fabs(place_at(way).curvature_1_m) : 1;
  const auto pace = dynamics::wheels_of_body(p, run_->turn == 0 ? 1 : 0, turn);
  const double fastest = std::max(std::fabs(pace[0]), std::fabs(pace[1]));
  double v = run_->turn == 0 ? l.speed_m_s : unlimited;
  Bound bound = Bound::speed;
  if (const double by_yaw = l.yaw_rate_rad_s / turn; by_yaw < v) v = by_yaw, bound = Bound::yaw_rate;
  if (const double by_wheel = l.wheel_speed_rad_s / fastest; by_wheel < v)
    v = by_wheel, bound = Bound::wheel_speed;
  if (!std::isfinite(v)) {
    // The grid needs a bound: no motor turns faster than its voltage allows, here at most four times the
    // battery's.
    const double volts =
        std::isfinite(l.voltage_v) ? l.voltage_v : 4 * std::max(24.0, robot_->battery.nominal_voltage_v);
    v = volts / (p.voltage_constant_v_s_rad * fastest), bound = Bound::wheel_speed;
  }
  return {v * v, bound};
}

double RunPlanner::acceleration_limit() const {
  const double limit = problem_->limits.acceleration_m_s2;
  return run_->turn == 0 ? limit : limit / robot_->kinematics.half_track_m;
}

// The voltage that the limit leaves to a driving motor after its brushes.
double RunPlanner::voltage_limit_v() const {
  const Electric& e = loads_->electric();
  return problem_->limits.voltage_v - e.brush_w_nm * e.torque_constant_nm_a;
}

// Whether a uniform run's motors would exceed their current or voltage limit.
bool RunPlanner::motors_break(double v, double q) const {
  const Electric& e = loads_->electric();
  const double torque_limit = problem_->limits.current_a * e.torque_constant_nm_a;
  for (std::size_t s : {0u, 1u}) {
    const WheelLoad& w = loads_here_[s];
    const double t = w.inertia * q + w.t0 + w.f0 + w.f1 * v;
    const double volts = e.volts_per_nm[s] * t + e.voltage_constant_v_s_rad * w.pace * v;
    if (std::fabs(t) > torque_limit || std::fabs(volts) > problem_->limits.voltage_v) return true;
  }
  return false;
}

// Whether torque and voltage, linear in speed and acceleration, keep their limits up to a speed and an
// acceleration: they do where they do at the corners.
bool RunPlanner::motors_hold(double top, double most) const {
  return !motors_break(0, -most) && !motors_break(0, most) && !motors_break(top, -most) &&
         !motors_break(top, most);
}

// Prepares the closed form where power is quadratic.
void RunPlanner::find_line() {
  const Electric& e = loads_->electric();
  const WheelLoads& w = loads_here_;
  if (!w[0].linear() || !w[1].linear() || e.brush_w_nm != 0) return;
  motor_power_ = {motor_power(e, 0, w[0]), motor_power(e, 1, w[1])};
  LineTask task;
  task.power = motor_power_[0];
  task.power += motor_power_[1];
  for (double* c :
       {&task.power.c1, &task.power.cx, &task.power.ca, &task.power.c2, &task.power.c3, &task.power.c0}) {
    *c *= e.up;
  }
  task.power.c0 += e.idle_w;
  task.distance = run_->length();
  task.start_speed = start_, task.end_speed = end_;
  line_ = task;
  const Limits& l = problem_->limits;
  const double top = std::sqrt(ceiling_at(0)), most = acceleration_limit();
  motors_never_break_ = (!std::isfinite(l.current_a) && !std::isfinite(l.voltage_v)) ||
                        (std::isfinite(most) && motors_hold(top, most));
  shortest_s_ = std::max(start_, end_) <= top ? shortest_time_within(task, top, most)
                                              : std::numeric_limits<double>::infinity();
  if (std::fabs(start_ * start_ - end_ * end_) > 2 * most * task.distance * (1 + 1e-9))
    shortest_s_ = std::numeric_limits<double>::infinity();
}

// Prepares the quadrature over the speed.
void RunPlanner::find_motion() {
  UniformTask task;
  task.loads = loads_here_;
  task.electric = loads_->electric();
  task.distance = run_->length();
  task.start_speed = start_, task.end_speed = end_;
  task.speed_limit = std::sqrt(ceiling_at(0));
  task.acceleration_limit = acceleration_limit();
  const bool motors_bind = !line_ || !motors_never_break_;
  task.torque_limit_nm =
      motors_bind ? problem_->limits.current_a * task.electric.torque_constant_nm_a : unlimited;
  task.voltage_limit_v = motors_bind ? voltage_limit_v() : unlimited;
  task.cells = std::max<std::size_t>(8, problem_->intervals_per_run);
  if (problem_->deadline_s || problem_->energy_budget_j || problem_->hurried)
    task.motor_tolerance = UniformMotion::hurried_tolerance;
  if (auto motion = UniformMotion::make(task)) motion_ = std::make_unique<UniformMotion>(*motion);
}

RunAnswer RunPlanner::answer_of(SteppedMotion motion) const {
  RunAnswer answer;
  answer.method = Method::quadrature;
  answer.convex = loads_->electric().down >= 0;  // else a braking motor's power is concave in its torque
  answer.peak_speed = *std::max_element(motion.speed.begin(), motion.speed.end());
  answer.way = std::move(motion.way), answer.speed = std::move(motion.speed);
  answer.duration_s = motion.duration_s, answer.energy_j = motion.energy_j;
  answer.discretisation_j = motion.discretisation_j;
  answer.binding = motion.binding;
  constexpr auto speed = static_cast<std::size_t>(Bound::speed);
  if (std::exchange(answer.binding[speed], false))
    answer.binding[static_cast<std::size_t>(ceiling(0).bound)] = true;
  return answer;
}

SpeedGrid RunPlanner::grid_over(const std::vector<double>& nodes) const {
  const std::size_t n = nodes.size() - 1;
  SpeedGrid grid;
  grid.step.resize(n);
  grid.ceiling.resize(n + 1);
  for (std::size_t k = 0; k < n; ++k) grid.step[k] = nodes[k + 1] - nodes[k];
  for (std::size_t k = 0; k <= n; ++k) grid.ceiling[k] = ceiling_at(nodes[k]);
  const Limits& l = problem_->limits;
  grid.start = start_ * start_;
  grid.end = end_ * end_;
  grid.acceleration_limit = acceleration_limit();
  grid.torque_limit_nm = l.current_a * loads_->electric().torque_constant_nm_a;
  grid.voltage_limit_v = voltage_limit_v();
  grid.electric = loads_->electric();
  if (uniform_) {
    grid.loads = {in_cell(loads_here_)};
  } else {
    grid.loads.reserve(n);
    for (std::size_t k = 0; k < n; ++k) {
      grid.loads.push_back(in_cell(loads_->at(*run_, place_at(0.5 * (nodes[k] + nodes[k + 1])))));
    }
    add_end_loads(nodes, grid);
  }
  if (run_->turn == 0 && l.least_speed_m_s > 0) add_floor(grid);
  return grid;
}

// The least speed, reached from starts and left for stops with half of the acceleration that the limits allow
// at it: so the optimum remains free there.
void RunPlanner::add_floor(SpeedGrid& grid) const {
  constexpr double part = 0.5, unbound_m_s2 = 1e3;
  const double v = problem_->limits.least_speed_m_s;
  double most = std::min(grid.acceleration_limit, unbound_m_s2);
  for (std::size_t k = 0; k < grid.loads.size(); ++k) {
    const auto fits = [&](double q) { return motor_use(grid, grid.load(k), v, q).most() <= 1; };
    if (!fits(most) && fits(0)) most = last_that(fits, 0, most, 40);
  }
  grid.floor = v * v;
  grid.floor_acceleration = part * most;
}

void RunPlanner::build(std::vector<double> nodes) {
  nodes_ = std::move(nodes);
  solver_ = std::make_unique<SpeedSolver>(grid_over(nodes_));
}

// Only where motors could come near their limits.
void RunPlanner::add_end_loads(const std::vector<double>& nodes, SpeedGrid& grid) const {
  bool near = false;
  for (std::size_t k = 0; k < grid.cells() && !near; ++k) {
    near = reachable(grid, grid.load(k), std::sqrt(std::max(grid.ceiling[k], grid.ceiling[k + 1])), 0.8) !=
           Reachable{};
  }
  if (!near) return;
  grid.end_loads.reserve(grid.cells());
  double slope = 0;  // of the curvature, where the last cell ends
  for (std::size_t k = 0; k < grid.cells(); ++k) {
    // The slope of the curvature, the direction of a wheel, and what depends on the position may jump at a
    // node.
    const auto inside = [&](double share) { return place_at(nodes[k] + share * grid.step[k]); };
    const auto within = [&](const Place& here) { return in_cell(loads_->at(*run_, here)); };
    const Place first = inside(1e-6), last = inside(1 - 1e-6);
    const CellLoads* before = k > 0 && first.curvature_slope == slope ? &grid.end_loads[k - 1][1] : nullptr;
    const bool even = before && !(*before)[0].full && !(*before)[1].full && !loads_->needs_position();
    grid.end_loads.push_back({even ? *before : within(first), within(last)});
    slope = last.curvature_slope;
  }
}

Result<void> RunPlanner::check_feasible() const {
  const SpeedGrid& grid = solver_->grid();
  const SpeedEnvelope& e = solver_->envelope();
  const double top = std::sqrt(grid.ceiling.front()), top_end = std::sqrt(grid.ceiling.back());
  if (start_ > top * (1 + 1e-9)) {
    return fail(Fault::infeasible, "start_speed_m_s",
                "is " + number(start_) + ", at most " + number(top) + " is allowed there");
  }
  if (end_ > top_end * (1 + 1e-9)) {
    return fail(Fault::infeasible, "end_speed_m_s",
                "is " + number(end_) + ", at most " + number(top_end) + " is allowed there");
  }
  for (std::size_t k = 0; k < grid.cells(); ++k) {
    for (std::size_t s : {0u, 1u}) {
      const double standing = standing_torque_nm(grid.load(k)[s]);
      if (standing >= grid.torque_limit_nm) {
        return fail(Fault::infeasible, "limits/current_a",
                    "is " + number(problem_->limits.current_a) + ", friction and slope alone need " +
                        number(standing / loads_->electric().torque_constant_nm_a));
      }
      const double brushes = problem_->limits.voltage_v - voltage_limit_v();
      const double volts = grid.electric.volts_per_nm[s] * standing + brushes;
      if (volts >= problem_->limits.voltage_v) {
        return fail(Fault::infeasible, "limits/voltage_v",
                    "is " + number(problem_->limits.voltage_v) +
                        ", by default the battery's nominal voltage; friction and slope alone need " +
                        number(volts));
      }
    }
  }
  if (e.feasible) return {};
  const double where = nodes_[std::min(e.broken_at, nodes_.size() - 1)];
  if (const double fast = e.fastest[e.broken_at]; e.broken_at > 0 && grid.floor > fast) {
    const auto lowest = std::ranges::min_element(grid.ceiling);
    const double bend = nodes_[static_cast<std::size_t>(lowest - grid.ceiling.begin())];
    const bool bound = *lowest < grid.floor;
    return fail(
        Fault::infeasible, "limits/least_speed_m_s",
        fmt::format("is {:.4g}, {} at most {:.4g} {:.4g} m along the way", problem_->limits.least_speed_m_s,
                    bound ? fmt::format("{} allows", name_of(ceiling(bend).bound))
                          : std::string("the other limits allow"),
                    std::sqrt(bound ? *lowest : fast), bound ? bend : where));
  }
  if (e.broken_at == grid.cells()) {
    return fail(Fault::infeasible, "end_speed_m_s",
                "is " + number(end_) + ", the way is too short: at most " +
                    number(std::sqrt(e.fastest.back())) + " can be reached");
  }
  const double least_end =
      std::sqrt(std::max(0.0, grid.start - 2 * grid.acceleration_limit * run_->length()));
  if (end_ < least_end) {
    return fail(
        Fault::infeasible, "end_speed_m_s",
        "is " + number(end_) + ", the way is too short to brake: at least " + number(least_end) + " remains");
  }
  if (e.broken_at == 0) {
    return fail(Fault::infeasible, "start_speed_m_s",
                "is " + number(start_) + ", the limits allow at most " +
                    number(std::sqrt(e.fastest.front())) + " on this way");
  }
  SpeedGrid from_rest = grid;
  from_rest.start = 0;
  return fail(Fault::infeasible, "limits",
              "no speed satisfies them " + number(where) + " m along the way" +
                  (speed_envelope(from_rest).feasible ? "; starting from rest would" : ""));
}

std::vector<double> RunPlanner::first_nodes(std::size_t cells) const {
  const double length = run_->length();
  std::vector<double> nodes;
  if (uniform_) {
    // Denser towards both ends, where the speed changes: s = L (3 x^2 - 2 x^3).
    for (std::size_t k = 0; k <= cells; ++k) {
      const double x = static_cast<double>(k) / static_cast<double>(cells);
      nodes.push_back(length * x * x * (3 - 2 * x));
    }
    return nodes;
  }
  // Knots of the way, with spacing limited by the change of the quantities that loads and limits depend on:
  // the way, the curvature, its slope, and the ceiling, which is enforced at nodes only. Longer segments
  // between knots are divided.
  const double smallest = 1e-6 * length, count = static_cast<double>(cells);
  const double most_m = length / count, most_1_m = 20 / count, most_1_m2 = 3.2 / count, most_log = 4 / count;
  nodes.push_back(0);
  double share = 0, slope = 0, square = ceiling_at(0);  // share of a cell since the last node
  for (std::size_t k = 1; k < run_->knots.size(); ++k) {
    const Knot &a = run_->knots[k - 1], &b = run_->knots[k];
    const double gap = b.way - a.way, bend = b.curvature_1_m - a.curvature_1_m;
    const double before = std::exchange(square, ceiling_at(b.way));
    const double here =
        gap / most_m + std::fabs(bend) / most_1_m + std::fabs(std::log(square / before)) / most_log;
    share += here + std::fabs(bend / gap - slope) / most_1_m2;
    slope = bend / gap;
    if (share > 1 && a.way > nodes.back()) nodes.push_back(a.way), share = here;
    const double cuts = std::ceil(here - 1e-9);
    for (double i = 1; i < cuts; ++i) nodes.push_back(a.way + gap * i / cuts), share = here / cuts;
  }
  nodes.push_back(length);
  // Near the ends the speed changes with the root of the way: nodes even in time, s = L/2 (j/m)^2, until
  // their spacing reaches the grid's.
  std::vector<double> graded;
  const double m = 0.5 * static_cast<double>(cells), half = 0.5 * length, widest = nodes[1] - nodes[0];
  for (double j = 1; j < m; ++j) {
    if (half * (2 * j + 1) / (m * m) > std::max(widest, nodes[nodes.size() - 1] - nodes[nodes.size() - 2]))
      break;
    const double way = half * (j / m) * (j / m);
    graded.push_back(way);
    graded.push_back(length - way);
  }
  nodes.insert(nodes.end(), graded.begin(), graded.end());
  std::sort(nodes.begin(), nodes.end());
  // Nodes of both families that nearly coincide are one.
  std::vector<double> apart{0};
  for (std::size_t k = 1; k + 1 < nodes.size(); ++k) {
    const double next = nodes[k + 1] - nodes[k], before = nodes[k] - apart.back();
    if (before > 0.3 * next && length - nodes[k] > smallest) apart.push_back(nodes[k]);
  }
  apart.push_back(length);
  // Neighbouring cells differ by a factor of two at most, so that a fast change does not end in a coarse
  // cell.
  for (bool split = true; split && apart.size() < most_cells;) {
    split = false;
    std::vector<double> smooth{0};
    for (std::size_t k = 1; k < apart.size(); ++k) {
      const double h = apart[k] - apart[k - 1];
      const double before = k > 1 ? apart[k - 1] - apart[k - 2] : h;
      const double after = k + 1 < apart.size() ? apart[k + 1] - apart[k] : h;
      if (h > 2.1 * std::min(before, after)) {
        smooth.push_back(apart[k - 1] + h / 2);
        split = true;
      }
      smooth.push_back(apart[k]);
    }
    apart = std::move(smooth);
  }
  return with_corners(std::move(apart));
}

// Where the slope of the curvature jumps, torque does, and where a wheel reverses, its dry friction: such
// places are nodes exactly.
std::vector<double> RunPlanner::with_corners(std::vector<double> nodes) const {
  constexpr double jump_1_m2 = 0.05;
  const auto& knots = run_->knots;
  const auto slope = [&](std::size_t k) {
    return (knots[k].curvature_1_m - knots[k - 1].curvature_1_m) / (knots[k].way - knots[k - 1].way);
  };
  std::vector<double> corners;
  const double reversing = 1 / loads_->model().parameters().half_track_m;
  for (std::size_t k = 1; k < knots.size(); ++k) {
    const Knot &a = knots[k - 1], &b = knots[k];
    for (const double curvature : {-reversing, reversing}) {
      if ((a.curvature_1_m < curvature) != (b.curvature_1_m < curvature))
        corners.push_back(a.way + (curvature - a.curvature_1_m) / slope(k));
    }
    if (k + 1 < knots.size() && !(std::fabs(slope(k + 1) - slope(k)) < jump_1_m2)) corners.push_back(b.way);
  }
  std::ranges::sort(corners);
  double last = 0;
  for (const double corner : corners) {
    const double before = std::exchange(last, corner);
    const auto after = std::lower_bound(nodes.begin() + 1, nodes.end() - 1, corner);
    if (*after == corner || nodes.size() < 4) continue;
    const auto near =
        after - 1 > nodes.begin() && corner - *(after - 1) < *after - corner ? after - 1 : after;
    if (*near != before && near + 1 < nodes.end() &&
        std::fabs(*near - corner) < 0.5 * (*(near + 1) - *(near - 1)))
      *near = corner;
    else
      nodes.insert(after, corner);
  }
  return nodes;
}

// Nodes that share time and change of speed evenly.
std::vector<double> RunPlanner::refined_nodes(const std::vector<double>& z, std::size_t cells) const {
  const std::size_t n = nodes_.size() - 1;
  double duration = 0, change = 1e-300, sway = 1e-300;
  std::vector<double> times(n), changes(n), bends(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double v0 = std::sqrt(z[k]), v1 = std::sqrt(z[k + 1]);
    times[k] = 2 * (nodes_[k + 1] - nodes_[k]) / (v0 + v1);
    changes[k] = std::fabs(v1 - v0);
    duration += times[k], change += changes[k];
  }
  // Where the acceleration itself changes, cells should be short.
  for (std::size_t k = 0; k < n; ++k) {
    const auto slope = [&](std::size_t i) { return (z[i + 1] - z[i]) / (nodes_[i + 1] - nodes_[i]); };
    bends[k] = std::fabs(slope(std::min(k + 1, n - 1)) - slope(k > 0 ? k - 1 : 0));
    sway += bends[k];
  }
  std::vector<double> reached(n + 1, 0);
  for (std::size_t k = 0; k < n; ++k) {
    reached[k + 1] =
        reached[k] + 0.35 * times[k] / duration + 0.3 * changes[k] / change + 0.35 * bends[k] / sway;
  }
  std::vector<double> nodes{0};
  std::size_t k = 0;
  for (std::size_t i = 1; i < cells; ++i) {
    const double target = reached[n] * static_cast<double>(i) / static_cast<double>(cells);
    while (k + 1 < n && reached[k + 1] < target) ++k;
    const double f = std::clamp((target - reached[k]) / (reached[k + 1] - reached[k]), 0.0, 1.0);
    // Evenly in time within the old cell.
    const double v0 = std::sqrt(z[k]), v1 = std::sqrt(z[k + 1]), v = v0 + f * (v1 - v0);
    const double way = nodes_[k] + f * times[k] * 0.5 * (v0 + v);
    if (way > nodes.back() + 1e-7 * run_->length()) nodes.push_back(way);
  }
  while (nodes.size() > 2 && nodes.back() > (1 - 1e-7) * run_->length()) nodes.pop_back();
  nodes.push_back(run_->length());
  return nodes;
}

std::vector<double> RunPlanner::resampled(const std::vector<double>& nodes, const std::vector<double>& z,
                                          const std::vector<double>& onto) const {
  std::vector<double> result;
  result.reserve(onto.size());
  std::size_t k = 0;
  for (double way : onto) {
    while (k + 2 < nodes.size() && nodes[k + 1] < way) ++k;
    const double f = std::clamp((way - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0, 1.0);
    result.push_back(z[k] + f * (z[k + 1] - z[k]));
  }
  return result;
}

Result<RunPlanner> RunPlanner::make(const robot::RobotModel& robot, const DriveLoads& loads, const Run& run,
                                    const std::optional<WheelLoads>& uniform, const Problem& problem,
                                    double start_speed, double end_speed) {
  RunPlanner planner(robot, loads, run, problem);
  planner.start_ = start_speed;
  planner.end_ = end_speed;
  planner.uniform_ = uniform.has_value();
  if (!planner.uniform_ && run.knots.size() > most_cells) {
    return fail(Fault::too_large, "path",
                "has a run between stops of more than 200000 knots, which are 1 cm apart on curves; give it "
                "in parts");
  }
  if (uniform) planner.loads_here_ = *uniform;
  if (planner.uniform_ && (run.turn != 0 || problem.limits.least_speed_m_s == 0)) {
    planner.find_line();
    // Without active motor limits, the closed form determines feasibility; the grid is built only when it is
    // needed.
    if (planner.line_ && planner.motors_never_break_ && std::isfinite(planner.shortest_s_)) return planner;
    planner.find_motion();
    planner.shortest_s_ = 0;
    // From rest to rest some motion covers any way.
    const bool rests = start_speed == 0 && end_speed == 0;
    if (planner.motion_ && (rests || std::isfinite(planner.shortest_s()))) return planner;
    planner.motion_.reset();
  }
  TRY(planner.build_grid());
  return planner;
}

bool RunPlanner::answers(const Run& other, const WheelLoads& loads, double start_speed,
                         double end_speed) const {
  const auto bend = [](const Run& run) { return std::fabs(run.knots.front().curvature_1_m); };
  return uniform_ && start_ == start_speed && end_ == end_speed && run_->length() == other.length() &&
         (run_->turn == 0) == (other.turn == 0) && bend(*run_) == bend(other) &&
         (loads_here_ == loads ||
          (loads_->electric().symmetric() && loads_here_ == WheelLoads{loads[1], loads[0]}));
}

double RunPlanner::shortest_s() {
  if (solver_) return fastest_motion().solution.duration_s;
  if (shortest_s_ == 0 && motion_) shortest_s_ = motion_->shortest_s();
  return shortest_s_;
}

// The profile of the envelope, on cells that are divided until what they lose is a small share of the time.
// The nodes do not depend on solutions, so the shortest time is a constant of the run.
const RunPlanner::FastMotion& RunPlanner::fastest_motion() {
  if (fastest_) return *fastest_;
  FastMotion fastest;
  std::vector<double> nodes = rough_solver_ ? rough_nodes_ : nodes_;
  SpeedSolver& first = rough_solver_ ? *rough_solver_ : *solver_;
  SpeedGrid finer;
  SpeedEnvelope e = first.envelope();
  for (int round = 0; round == 0 || (round <= most_rounds && e.feasible); ++round) {
    const SpeedGrid& grid = round == 0 ? first.grid() : finer;
    SpeedSolution s;
    s.z = e.fastest, s.duration_s = e.shortest_s;
    const auto binds = [&](Bound bound, double share) {
      s.binding[static_cast<std::size_t>(bound)] |= share > at_limit;
    };
    std::vector<MotorUse> uses;
    for (std::size_t k = 0; k < grid.cells(); ++k) {
      const MotorUse& use = uses.emplace_back(motor_use(grid, k, s.z[k], s.z[k + 1]));
      if (k > 0) binds(Bound::speed, s.z[k] / grid.ceiling[k]);
      binds(Bound::acceleration,
            std::fabs(s.z[k + 1] - s.z[k]) / (2 * grid.step[k] * grid.acceleration_limit));
      binds(Bound::current, use.current), binds(Bound::voltage, use.voltage);
    }
    Losses lost{lost_at_ends_s(grid, s.z, uses), lost_at_corners_s(grid, s.z)};
    // The first and the last cell could hold the faster of their ends' speeds but for the acceleration.
    for (const std::size_t k : {std::size_t{0}, grid.cells() - 1}) {
      if (lost.by_parts[k] > 0) continue;
      const double faster = std::sqrt(std::max(s.z[k], s.z[k + 1])), mean = mean_speed(s.z[k], s.z[k + 1]),
                   ramp_s = 2 * (faster - mean) / grid.acceleration_limit;
      lost.by_parts[k] = (1 / mean - 1 / faster) * std::max(0.0, grid.step[k] - ramp_s * mean);
    }
    const double most_s = lost_tolerance * s.duration_s;
    const std::vector<double> parts = least_parts(grid, nodes, s.z, round == 0 ? 2 : 1);
    fastest = {std::move(nodes), std::move(s)};
    if (lost.sum() <= most_s && std::ranges::max(parts) == 1) break;
    nodes = split(fastest.nodes, lost, 0.8 * most_s, parts);
    finer = grid_over(nodes), e = speed_envelope(finer);
  }
  return fastest_.emplace(std::move(fastest));
}

std::optional<double> RunPlanner::cruise_speed(double price_w) {
  if (!uniform_) return {};
  if (line_ && motors_never_break_) {
    LineTask task = *line_;
    task.value_of_time_w = price_w;
    return std::min(best_speed_of(task), std::sqrt(ceiling_at(0)));
  }
  if (!motion_ && !solver_) find_motion();
  if (!motion_) return {};
  return motion_->cruise_speed(price_w);
}

std::optional<RestMotion> RunPlanner::to_peak(double peak, double price_w) {
  const Electric& e = loads_->electric();
  if (line_ && e.up == e.down) {
    LineTask task = *line_;
    task.value_of_time_w = price_w;
    if (peak < best_speed_of(task)) {
      const LineMotion line = line_to_peak(task, peak, acceleration_limit());
      if (motors_never_break_ || motors_hold(peak, line.peak_acceleration()))
        return RestMotion{line.distance(), line.duration_s(), line.energy_j()};
    }
  }
  if (!motion_ && !solver_) find_motion();
  if (!motion_) return {};
  return motion_->to_peak(peak, price_w);
}

double RunPlanner::steady_power_w(double speed) const {
  const dynamics::Instant at = loads_->instant(*run_, place_at(0), speed, 0);
  return loads_->model().flow(at).battery_power_w;
}

std::size_t RunPlanner::nodes() const {
  return nodes_.size() + rough_nodes_.size() + (fastest_ ? fastest_->nodes.size() : 0);
}

Result<void> RunPlanner::build_grid() {
  const std::size_t cells = std::max<std::size_t>(8, problem_->intervals_per_run);
  build(first_nodes(uniform_ ? cells / 2 : cells));
  return check_feasible();
}

std::optional<RunAnswer> RunPlanner::closed_form(double price_w) const {
  if (!line_) return {};
  const Electric& e = loads_->electric();
  LineTask task = *line_;
  task.value_of_time_w = price_w;
  const Ceiling highest = ceiling(0);
  const auto line = line_within(task, std::sqrt(highest.square), acceleration_limit());
  if (!line) return {};
  const double top = line->peak_speed(), most = line->peak_acceleration();
  const bool lossy = e.up != e.down;
  // The corners of the box that the profile stays in decide quickly, its samples where they do not.
  const bool sure = motors_never_break_ || motors_hold(top, most);
  if (lossy || !sure) {
    for (const double t : line->times(128)) {
      const auto [way, v, q] = line->state(t);
      if (!sure && motors_break(v, q)) return {};
      if (lossy && (motor_power_[0].power_w(v, q) < 0 || motor_power_[1].power_w(v, q) < 0)) return {};
    }
  }
  RunAnswer answer;
  answer.energy_j = line->energy_j();
  answer.duration_s = line->duration_s();
  answer.residual = line->residual_w() / (task.power.c0 + price_w);
  answer.binding[static_cast<std::size_t>(Bound::acceleration)] = line->holds_acceleration();
  if (top >= std::sqrt(highest.square) * (1 - 1e-9))
    answer.binding[static_cast<std::size_t>(highest.bound)] = true;
  answer.peak_speed = top;
  answer.line = std::make_unique<LineMotion>(*line);
  return answer;
}

// In how many parts each cell is to be divided at least, so that motors keep their limits between its ends as
// well: in its middle, what exceeds them falls with the square of the cell; at knots, where the torque jumps,
// it lasts until they are nodes.
std::vector<double> RunPlanner::least_parts(const SpeedGrid& grid, const std::vector<double>& nodes,
                                            const std::vector<double>& z, double least) const {
  std::vector<double> parts(grid.cells(), least);
  for (std::size_t k = 0; k < grid.cells(); ++k) {
    const double q = (z[k + 1] - z[k]) / (2 * grid.step[k]);
    const auto beyond = [&](const CellLoads& loads, double way) {
      return motor_use(grid, loads, std::sqrt(z[k] + 2 * q * (way - nodes[k])), q).most() - 1;
    };
    const double middle = beyond(grid.load(k), nodes[k] + 0.5 * grid.step[k]);
    if (middle > over_between_rows)
      parts[k] = std::max(least, std::ceil(std::sqrt(middle / over_between_rows)));
    if (grid.end_loads.empty() || middle < -near_limits) continue;
    for (auto knot = knot_after(nodes[k]); knot->way < nodes[k + 1] && parts[k] != at_knots; ++knot) {
      for (const double side : {-1e-9, 0.0}) {
        const CellLoads here =
            in_cell(loads_->at(*run_, {*knot, place_at(knot->way + side).curvature_slope}));
        if (beyond(here, knot->way) > over_between_rows) parts[k] = at_knots;
      }
    }
  }
  return parts;
}

// Divides cells into parts so that their losses add up to at most `most`. The fewest parts whose losses add
// up to A, falling with the number of a cell's parts, and to B, with its square, are proportional to sqrt(a)
// and cbrt(b): sum(sqrt(a))^2/A and sqrt(sum(cbrt(b))^3/B) of them, in proportion to which `most` is shared.
// New nodes are at knots where some are near, for between knots loads change evenly.
std::vector<double> RunPlanner::split(const std::vector<double>& nodes, const Losses& lost, double most,
                                      const std::vector<double>& least) const {
  constexpr double most_parts = 8;
  double roots = 1e-100, cubes = 1e-100;
  for (const double each : lost.by_parts) roots += std::sqrt(each);
  for (const double each : lost.by_square) cubes += std::cbrt(each);
  const double all = roots * roots / most + cubes * std::sqrt(cubes / most);
  std::vector<double> finer{nodes.front()};
  for (std::size_t k = 0; k + 1 < nodes.size(); ++k) {
    const double wanted =
        std::ceil(std::max(std::sqrt(lost.by_parts[k]) * all / roots,
                           std::cbrt(lost.by_square[k]) * std::sqrt(all / std::sqrt(cubes * most))) -
                  0.5);
    const bool knots = least[k] == at_knots;
    const double parts =
        nodes.size() > most_cells ? 1 : std::min(knots ? wanted : std::max(wanted, least[k]), most_parts);
    const double part = (nodes[k + 1] - nodes[k]) / parts;
    const auto divide_to = [&](double way) {
      const double from = finer.back(), count = std::round((way - from) / part);
      for (double i = 1; i < count; ++i) finer.push_back(from + i / count * (way - from));
      finer.push_back(way);
    };
    auto knot = knot_after(nodes[k]);
    if (knots) {
      for (; knot->way < nodes[k + 1]; ++knot) divide_to(knot->way);
      divide_to(nodes[k + 1]);
    } else {
      for (double i = 1; i < parts; ++i) {
        const double even = nodes[k] + part * i;
        while (knot->way < even - 0.5 * part) ++knot;
        const double way = knot->way < even + 0.5 * part ? knot->way : even;
        if (way > finer.back() && way < nodes[k + 1]) finer.push_back(way);
      }
      finer.push_back(nodes[k + 1]);
    }
  }
  return finer;
}

Result<RunAnswer> RunPlanner::solve(double price_w, const std::stop_token& stop,
                                    const std::optional<Due>& due) {
  if (stop.stop_requested()) return stopped();
  if (!std::isfinite(price_w)) return fastest();
  if (auto answer = closed_form(price_w); answer && !due) return std::move(*answer);
  if (uniform_ && !motion_ && !solver_) find_motion();
  if (motion_) {
    TRY_ASSIGN(SteppedMotion motion, motion_->solve(price_w));
    return answer_of(std::move(motion));
  }
  if (!solver_) TRY(build_grid());
  TRY_ASSIGN(const SpeedSolution solution, solve_grid(price_w, stop, due));
  return answer_of(solution, nodes_);
}

Result<RunAnswer> RunPlanner::solve_roughly(double price_w, const std::stop_token& stop) {
  if (!solver_) {
    auto answer = solve(price_w, stop);
    if (!solver_) return answer;
  }
  if (const double standing = standing_power_w(solver_->grid()) + price_w; !(standing > 0))
    return endless(standing);
  const SpeedSolution& s = solve_rough_grid(price_w, stop);
  if (!s.converged) return solve(price_w, stop);
  RunAnswer answer;
  answer.method = Method::interior_point;
  answer.duration_s = s.duration_s;
  answer.energy_j = s.cost_j - price_w * s.duration_s;
  answer.iterations = s.iterations;
  return answer;
}

const SpeedSolution& RunPlanner::solve_rough_grid(double price_w, const std::stop_token& stop,
                                                  const std::optional<Due>& due) {
  if (price_w == rough_price_w_ && !due) return rough_;
  rough_ = (rough_solver_ ? rough_solver_ : solver_)->solve(price_w, coarse_tolerance, stop, due);
  rough_price_w_ = rough_.price_w;
  return rough_;
}

Result<SpeedSolution> RunPlanner::solve_grid(double price_w, const std::stop_token& stop,
                                             const std::optional<Due>& due) {
  if (const double standing = standing_power_w(solver_->grid()) + price_w; !(standing > 0))
    return endless(standing);
  SpeedSolution s;
  if (refined_ && !due) s = solver_->solve(price_w, fine_tolerance, stop);
  if (!s.converged) {
    // Another price of time may need other nodes.
    if (std::exchange(refined_, false)) build(rough_nodes_);
    s = solve_rough_grid(price_w, stop, due);
    // A first grid may not be as fast as finer ones.
    if (due && !s.converged) s = solve_rough_grid(price_w, stop);
  }
  int iterations = s.iterations;
  std::vector<double> driven;
  Losses lost;
  // A coarse solution is the starting point of the fine one, determines the placement of its nodes, and
  // yields its error.
  for (int round = 0; s.converged; ++round) {
    driven = driven_j(nodes_, s.z);
    lost = lost_j(s, driven);
    const double most = lost_tolerance * std::fabs(s.cost_j);
    const bool grown = round == most_rounds ||
                       nodes_.size() >= (uniform_ ? most_uniform_growth : most_growth) * rough_nodes_.size();
    const std::vector<double> parts = least_parts(solver_->grid(), nodes_, s.z, refined_ ? 1 : 2);
    if (refined_ && (grown || (lost.sum() <= most && std::ranges::max(parts) == 1))) break;
    const std::vector<double> coarse_nodes = nodes_;
    const auto rebuild = [&](std::vector<double> onto) {
      const std::vector<double> start = resampled(coarse_nodes, s.z, onto);
      if (!rough_solver_) {
        rough_nodes_ = coarse_nodes;
        rough_solver_ = std::move(solver_);
      }
      build(std::move(onto));
      solver_->start_from(start);
    };
    rebuild(uniform_ && !refined_ ? refined_nodes(s.z, std::max<std::size_t>(8, problem_->intervals_per_run))
                                  : split(nodes_, lost, 0.8 * most, parts));
    SpeedSolution finer = solver_->solve(s.price_w, fine_tolerance, stop, due);
    if (due && !finer.converged) finer = solver_->solve(s.price_w, fine_tolerance, stop);
    if (!finer.converged || (refined_ && !finer.stationary())) {
      if (!refined_) s.gap_j = s.cost_j;  // the error of a coarse grid is unknown
      rebuild(coarse_nodes);
      break;
    }
    iterations += finer.iterations;
    // At one price; a change of price changes its optimum by that times a duration between the two.
    const double dearer_w = finer.price_w - s.price_w,
                 error_j = std::fabs(s.cost_j + dearer_w * s.duration_s - finer.cost_j) -
                           std::fabs(dearer_w * (finer.duration_s - s.duration_s));
    coarse_error_ = std::max(coarse_error_, error_j / std::fabs(finer.cost_j));
    refined_ = true;
    s = std::move(finer);
  }
  if (stop.stop_requested()) return stopped();
  // Nothing bounds the optimum from below then but that energy is not negative.
  if (!s.converged) driven = driven_j(nodes_, s.z), s.gap_j = s.cost_j, s.convex = false;
  s.iterations = iterations;
  s.cost_j = sum_of(driven) + s.price_w * s.duration_s;
  discretisation_j_ = coarse_error_ * std::fabs(s.cost_j) + lost.sum();
  return s;
}

// Energy of each cell as it is driven, by the drive model [J].
std::vector<double> RunPlanner::driven_j(const std::vector<double>& nodes,
                                         const std::vector<double>& z) const {
  std::vector<double> energy(nodes.size() - 1, 0);
  for (std::size_t k = 0; k < energy.size(); ++k) {
    const double v0 = std::sqrt(z[k]), change = std::sqrt(z[k + 1]) - v0;
    const double span = (nodes[k + 1] - nodes[k]) / (v0 + 0.5 * change);
    const int parts = loads_->scrubs() ? loads_->at(*run_, place_at(nodes[k]))[0].parts(v0, v0 + change) : 1;
    for (int part = 0; part < parts; ++part) {
      for (const auto& [place, weight] : gauss2) {
        const double at = (part + place) / parts, way = nodes[k] + at * span * (v0 + 0.5 * at * change);
        const dynamics::Instant instant =
            loads_->instant(*run_, place_at(way), v0 + at * change, change / span);
        energy[k] += weight * span / parts * loads_->model().flow(instant).battery_power_w;
      }
    }
  }
  return energy;
}

// Cost of each cell beyond the solver's estimate: loads and the flow of power change within it; time lost at
// corners; limits of motors at its ends [J].
RunPlanner::Losses RunPlanner::lost_j(const SpeedSolution& s, const std::vector<double>& driven) const {
  Losses lost{s.ends_j, lost_at_corners_s(solver_->grid(), s.z)};
  lost.by_parts.resize(driven.size());
  const std::vector<double> reckoned = solver_->costs_j(s.z, s.price_w);
  for (std::size_t k = 0; k < driven.size(); ++k) {
    const double time_j = s.price_w * solver_->grid().step[k] / mean_speed(s.z[k], s.z[k + 1]);
    lost.by_parts[k] += std::max(0.0, driven[k] + time_j - reckoned[k]);
    lost.by_square[k] *= s.price_w;
  }
  return lost;
}

RunAnswer RunPlanner::answer_of(const SpeedSolution& s, const std::vector<double>& nodes) const {
  RunAnswer answer;
  answer.method = Method::interior_point;
  answer.way = nodes;
  for (const double z : s.z) answer.speed.push_back(std::sqrt(z));
  answer.peak_speed = *std::max_element(answer.speed.begin(), answer.speed.end());
  answer.duration_s = s.duration_s;
  answer.price_w = s.price_w;
  answer.energy_j = s.cost_j - s.price_w * s.duration_s;
  answer.gap_j = s.gap_j;
  answer.discretisation_j = discretisation_j_;
  answer.residual = s.residual;
  answer.convex = s.convex && loads_->electric().idle_w + s.price_w >= 0;
  answer.iterations = s.iterations;
  answer.binding = s.binding;
  if (s.binding[static_cast<std::size_t>(Bound::speed)]) {
    // Determine which of the limits behind the ceiling is binding, where the profile is closest to it.
    answer.binding[static_cast<std::size_t>(Bound::speed)] = false;
    for (std::size_t k = 1; k + 1 < nodes.size(); ++k) {
      if (const Ceiling here = ceiling(nodes[k]); s.z[k] > (1 - 2e-3) * here.square)
        answer.binding[static_cast<std::size_t>(here.bound)] = true;
    }
  }
  return answer;
}

Result<RunAnswer> RunPlanner::fastest() {
  if (uniform_ && !motion_ && !solver_) find_motion();
  if (motion_) {
    auto motion = motion_->fastest();
    if (!motion)
      return fail(Fault::infeasible, "deadline_s",
                  "is the shortest time, which needs a limit of acceleration");
    return answer_of(std::move(*motion));
  }
  if (!solver_) TRY(build_grid());
  const FastMotion& fast = fastest_motion();
  RunAnswer answer = answer_of(fast.solution, fast.nodes);
  answer.energy_j = sum_of(driven_j(fast.nodes, fast.solution.z));
  answer.convex = !loads_->scrubs() && loads_->electric().down >= 0;
  answer.discretisation_j = 0;  // that of the last solution, at another price
  return answer;
}

}  // namespace joulecast::planning
