#include "planning/speed_solver.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

#include "dynamics/stribeck_curve.h"

namespace joulecast::planning {
namespace {

constexpr double just_below = 1e-9;  // a limit, relative

// Torque of a wheel without smoothing.
double torque_of(const WheelLoad& w, double v, double q) {
  const double direction = w.direction(v);
  double through = w.inertia * q + w.t0 + direction * w.t_dry + v * (w.t1 + v * w.t2);
  if (w.scrub != 0) through += w.scrub * std::tanh(v / w.scrub_speed);
  double t = through + direction * (w.gear * std::fabs(through) + w.f_dry) + w.f0 + v * (w.f1 + v * w.f2);
  if (w.stribeck != 0) t += w.stribeck * dynamics::stribeck_curve(v / w.stribeck_speed, w.stribeck_exponent);
  return t;
}

}  // namespace

CellLoads in_cell(const WheelLoads& loads) {
  const auto kept = [](const WheelLoad& w) -> CellLoad {
    return {w.pace,      w.inertia,   w.t0 + w.f0,
            w.t1 + w.f1, w.t2 + w.f2, w.quadratic() ? nullptr : std::make_shared<const WheelLoad>(w)};
  };
  return {kept(loads[0]), kept(loads[1])};
}

MotorUse motor_use(const SpeedGrid& grid, const CellLoads& loads, double v, double q) {
  MotorUse use;
  const Electric& e = grid.electric;
  for (std::size_t s : {0u, 1u}) {
    const CellLoad& w = loads[s];
    const auto reach = [&](double t) {
      const double volts = e.volts_per_nm[s] * t + e.voltage_constant_v_s_rad * w.pace * v;
      const auto reaches = [&](double share, double& of_limit) {
        double& most = share * w.inertia < 0 ? use.slowing : use.rising;
        most = std::max(most, std::fabs(share)), of_limit = std::max(of_limit, std::fabs(share));
      };
      reaches(t / grid.torque_limit_nm, use.current), reaches(volts / grid.voltage_limit_v, use.voltage);
    };
    reach(w.full ? torque_of(*w.full, v, q) : w.inertia * q + w.f0 + v * (w.f1 + v * w.f2));
    if (w.full && w.full->creep != 0) reach(torque_of(w.full->rolling(), v, q));
  }
  return use;
}

MotorUse motor_use(const SpeedGrid& grid, std::size_t cell, double z0, double z1) {
  const double q = (z1 - z0) / (2 * grid.step[cell]);
  const MotorUse first = motor_use(grid, grid.load(cell, 0), std::sqrt(z0), q),
                 last = motor_use(grid, grid.load(cell, 1), std::sqrt(z1), q);
  return {std::max(first.rising, last.rising), std::max(first.slowing, last.slowing),
          std::max(first.current, last.current), std::max(first.voltage, last.voltage),
          0.5 * std::fabs(first.most() - last.most())};
}

Reachable reachable(const SpeedGrid& grid, const CellLoads& loads, double v, double share) {
  Reachable may;
  const Electric& e = grid.electric;
  for (std::size_t s : {0u, 1u}) {
    const WheelLoad w = loads[s].whole();
    double low = -std::fabs(w.inertia) * grid.acceleration_limit + w.t0,
           high = std::fabs(w.inertia) * grid.acceleration_limit + w.t0;
    const auto grows_to = [&](double most) { (most < 0 ? low : high) += most; };
    for (const double most : {w.t_dry, v * w.t1, v * v * w.t2, w.scrub}) grows_to(most);
    const double gear = std::fabs(w.gear) * std::max(std::fabs(low), std::fabs(high));
    low += w.f0 - gear, high += w.f0 + gear;
    for (const double most : {w.f_dry, v * w.f1, v * v * w.f2, w.stribeck}) grows_to(most);
    const auto beyond = [&](double limit) {
      return std::array<bool, 2>{!(high < share * limit), !(low > -share * limit)};
    };
    if (std::isfinite(grid.torque_limit_nm)) may.torque[s] = beyond(grid.torque_limit_nm);
    if (!std::isfinite(grid.voltage_limit_v)) continue;
    low = e.volts_per_nm[s] * std::max(low, -grid.torque_limit_nm);
    high = e.volts_per_nm[s] * std::min(high, grid.torque_limit_nm);
    grows_to(e.voltage_constant_v_s_rad * w.pace * v);
    may.voltage[s] = beyond(grid.voltage_limit_v);
  }
  return may;
}

double mean_speed(double z0, double z1) {
  return 0.5 * (std::sqrt(z0) + std::sqrt(z1));
}

std::vector<double> floor_profile(const SpeedGrid& grid) {
  const std::vector<double> floor(grid.cells() + 1, grid.floor);
  return grid.floor == 0 ? floor : fastest_within(grid, floor, grid.floor_acceleration);
}

std::vector<double> slowest_profile(const SpeedGrid& grid, double acceleration) {
  const std::size_t n = grid.cells();
  std::vector<double> slowest = floor_profile(grid);
  if (!std::isfinite(acceleration)) return slowest;
  double z = grid.start;
  for (std::size_t k = 0; k <= n; ++k) {
    slowest[k] = std::max(slowest[k], z);
    if (k < n) z -= 2 * grid.step[k] * acceleration;
  }
  z = grid.end;
  for (std::size_t k = n + 1; k-- > 0;) {
    slowest[k] = std::max(slowest[k], z);
    if (k > 0) z -= 2 * grid.step[k - 1] * acceleration;
  }
  return slowest;
}

double duration_of(const SpeedGrid& grid, const std::vector<double>& z) {
  double sum = 0;
  for (std::size_t k = 0; k < grid.cells(); ++k) sum += grid.step[k] / mean_speed(z[k], z[k + 1]);
  return sum;
}

std::vector<double> fastest_within(const SpeedGrid& grid, std::vector<double> fastest, double acceleration) {
  fastest.front() = grid.start, fastest.back() = grid.end;
  for (std::size_t k = 0; k < grid.cells(); ++k)
    fastest[k + 1] = std::min(fastest[k + 1], fastest[k] + 2 * grid.step[k] * acceleration);
  for (std::size_t k = grid.cells(); k-- > 0;)
    fastest[k] = std::min(fastest[k], fastest[k + 1] + 2 * grid.step[k] * acceleration);
  return fastest;
}

SpeedEnvelope speed_envelope(const SpeedGrid& grid) {
  const std::size_t n = grid.cells();
  SpeedEnvelope e;
  e.fastest = grid.ceiling;
  e.fastest.front() = grid.start;
  e.fastest.back() = grid.end;

  const auto most_change = [&](std::size_t cell) { return 2 * grid.step[cell] * grid.acceleration_limit; };
  // A zero of a function that rises, by regula falsi (Illinois), or a place just below it.
  const auto zero = [](auto&& f, double low, double below, double high, double above) {
    for (int last = 0, k = 0; k < 100 && high - low > just_below * low; ++k) {
      const double z = low + (high - low) * below / (below - above), y = f(z);
      if (std::fabs(y) < just_below) return z;
      double& other = y > 0 ? below : above;
      if (const int side = y > 0 ? 1 : -1; std::exchange(last, side) == side) other *= 0.5;
      (y > 0 ? high : low) = z, (y > 0 ? above : below) = y;
    }
    return low;
  };
  // The greatest z between `low` and `high` that keeps the limits; `same` is the z of the cell's other end.
  const auto highest = [&](auto&& use_at, double low, double high, double same) {
    const auto excess = [&](double z) { return use_at(z) - (1 - just_below); };
    double above = excess(high);
    if (!(above > just_below)) return high;
    for (const double from : {same, 2 * same - high, low}) {
      if (!(from < high && from >= low)) continue;
      const double y = excess(from);
      if (y < 0) return zero(excess, from, y, high, above);
      high = from, above = y;
    }
    return low;
  };
  // The fastest at the far end of a cell that its near end and the motors allow.
  const auto fastest_after = [&](std::size_t cell, double near) {
    return highest([&](double far) { return motor_use(grid, cell, near, far).rising; },
                   std::max(0.0, near - most_change(cell)),
                   std::min(e.fastest[cell + 1], near + most_change(cell)), near);
  };
  // From which speeds a cell can be left within its bound, which may take slowing down. Then those from which
  // the start leads on as fast as possible (Pham & Pham, IEEE Trans. Robot. 34 (2018), sec. III).
  for (std::size_t k = n; k-- > 0;) {
    // The least share of the limits that some far end takes.
    const auto least = [&](double near) {
      const double low = std::max(0.0, near - most_change(k)),
                   high = std::min(e.fastest[k + 1], near + most_change(k));
      const auto use_at = [&](double far) { return motor_use(grid, k, near, far); };
      const MotorUse top = use_at(high);
      if (top.slowing > 1 || top.rising <= 1) return top.slowing;
      const MotorUse bottom = use_at(low);
      if (bottom.rising > 1 || bottom.slowing <= 1) return bottom.rising;
      const auto lean = [](const MotorUse& use) { return use.rising - use.slowing; };
      return use_at(zero([&](double far) { return lean(use_at(far)); }, low, lean(bottom), high, lean(top)))
          .most();
    };
    e.fastest[k] =
        highest(least, 0, std::min(e.fastest[k], e.fastest[k + 1] + most_change(k)), e.fastest[k + 1]);
  }
  for (std::size_t k = 0; k < n; ++k) e.fastest[k + 1] = fastest_after(k, e.fastest[k]);
  e.slowest = slowest_profile(grid, grid.acceleration_limit);
  const double slack = 1e-9;
  if (e.fastest.front() < grid.start * (1 - slack) || e.fastest.back() < grid.end * (1 - slack)) {
    e.feasible = false;
    e.broken_at = e.fastest.front() < grid.start * (1 - slack) ? 0 : n;
    return e;
  }
  for (std::size_t k = 1; k < n; ++k) {
    if (!(e.fastest[k] > e.slowest[k])) {
      e.feasible = false;
      e.broken_at = k;
      return e;
    }
  }
  e.shortest_s = duration_of(grid, e.fastest);
  e.feasible = std::isfinite(e.shortest_s);
  return e;
}

// The discrete problem is: minimise F(z) over the inner nodes' squared speeds, subject to g_j(z) <= 0, the
// limits of acceleration, torque, voltage, ceiling and floor, each over its bound. F is a sum over cells, and
// each g_j belongs to one cell, that is to two neighbouring nodes.
//
// With slacks s_j = -g_j the barrier problem is to minimise F - mu sum log s_j (Nocedal & Wright, Numerical
// Optimization, 2nd ed., (19.4)); its conditions are
//   grad F + sum y_j grad g_j = 0,   s_j y_j = mu                                              (19.2)
// in z and multipliers y > 0. Newton's method on them, with dy eliminated (19.12-19.13), solves
//   (Hess F + sum y_j Hess g_j + sum (y_j/s_j) grad g_j grad g_j') dz = -(grad F + sum (mu/s_j) grad g_j),
// with a tridiagonal matrix; then dy_j = mu/s_j - y_j + (y_j/s_j) grad g_j' dz. Slacks, those of motors
// linearised, and multipliers keep a share of themselves in each step (19.9); a line search makes the barrier
// function fall (3.4); an indefinite matrix is corrected along its diagonal (Waechter & Biegler, Math.
// Program. 106 (2006), algorithm IC). mu falls by a factor (their (7)) when its problem is about solved.
// Where a duration is due, the price of time is one more unknown, its equation one more row (follow_price).
// Where the problem is convex, sum y_j s_j bounds the remaining decrease of F; it is reported as the gap.
//
// Where braking begins to return energy, F has terms half_jump |E|, E the energy of a motor in a cell. They
// are smoothed to sqrt(E^2 + width^2), the width falling with mu, and the slope E/sqrt(...) is a dual
// variable of its own in (-1, 1), as y is; that keeps Newton's steps long at the kink (Andersen,
// Christiansen, Conn & Overton, SIAM J. Sci. Comput. 22 (2000), sec. 3).
namespace {

constexpr double to_boundary = 0.995;         // of a slack may be used up: tau of N&W (19.9)
constexpr double linear_share = 0.9;          // of it where a bound bends; without, a plan was 3e-3 dearer
constexpr double long_enough = 0.9;           // a step that is not corrected
constexpr int most_corrections = 4;           // of a step; 6 and 10 take no fewer steps
constexpr double least_product = 0.3;         // of s y over mu, after a step; 0.1 and 0.5 are like it
constexpr double sufficient_decrease = 1e-4;  // c_1 of N&W (3.4)
constexpr double first_correction = 1e-9;     // of the diagonal, W&B algorithm IC
constexpr double correction_growth = 8;       // kappa_w+ of W&B algorithm IC
constexpr double first_damping = 1e-4;        // of the diagonal, after a failed line search: delta_w0 of W&B
constexpr double least_pivot = 1e-13;         // of the diagonal's terms: less is their cancellation
constexpr double first_gap = 3e-2;            // bounds * mu over the cost, where the search begins
constexpr double first_gap_warm =
    1e-2;  // from a solution of a like problem; 1e-3 takes 12 % longer, 3e-3 and 3e-2 2 and 4 %
constexpr double price_share =
    0.01;  // of a change of price: the gap required after it; 0.003 and 0.1 take longer
constexpr double finest_gap = 1e-9;       // no tolerance is less
constexpr double barrier_decrease = 0.2;  // kappa_mu of W&B (7)
constexpr double quick_decrease = 0.05;   // after a full step with a decrement below the gap
constexpr int most_iterations = 200;
// Steps where a kink's slope lags behind z; 1 leaves plans 9e-4 dearer, 8 is like it.
constexpr int most_settling = 3;

// Bounds of a cell: acceleration, positive and negative; ceiling and floor of its first node; of the motors.
constexpr unsigned of_acceleration = 0, of_ceiling = 2, of_floor = 3, of_motors = 4;

// The first of the two bounds, positive and negative, of a motor at an end of a cell.
constexpr unsigned bound_of(std::size_t end, std::size_t side, bool voltage) {
  return static_cast<unsigned>(of_motors + 8 * end + (voltage ? 4 : 0) + 2 * side);
}
constexpr std::uint32_t bits(unsigned two_from) {
  return 3u << two_from;
}
constexpr std::uint32_t at_both_ends = 1u | 1u << (bound_of(1, 0, false) - bound_of(0, 0, false));

// A sum of logarithms, few of which are taken.
class Logarithms {
 public:
  void add(double x) {
    product_ *= x;
    if (product_ < 1e-200) sum_ += std::log(product_), product_ = 1;
  }
  double sum() const { return sum_ + std::log(product_); }

 private:
  double product_ = 1, sum_ = 0;
};

}  // namespace

SpeedSolver::SpeedSolver(SpeedGrid grid) : grid_(std::move(grid)), floor_(floor_profile(grid_)) {
  const std::size_t n = grid_.cells();
  assert(n >= 2 && grid_.ceiling.size() == n + 1);
  set_return(grid_.electric.down);
  cells_.resize(n);
  for (auto* v : {&z_, &trial_, &by_z_, &push_, &stationarity_, &diagonal_, &off_, &magnitude_, &gradient_,
                  &slope_, &by_price_, &pivot_, &lower_, &step_})
    v->assign(n + 1, 0);
  bounds_.assign(n, 0);
  first_bound_.assign(n + 1, 0);
  for (const CellLoads& loads : grid_.loads) scrubs_ = scrubs_ || loads[0].whole().scrub != 0;
  const std::vector<double> fastest = fastest_within(grid_, grid_.ceiling, grid_.acceleration_limit);
  for (std::size_t k = 0; k < n; ++k) {
    std::uint32_t mask = k > 0 ? bits(of_ceiling) : 0;
    if (std::isfinite(grid_.acceleration_limit)) mask |= bits(of_acceleration);
    // A bound is left out where no speed and acceleration inside the others can reach it.
    const double v = std::sqrt(std::max(fastest[k], fastest[k + 1]));
    for (const std::size_t end : {0u, 1u}) {
      const Reachable may = reachable(grid_, grid_.load(k, end), v, 0.99);
      for (const std::size_t s : {0u, 1u}) {
        for (const unsigned sign : {0u, 1u}) {
          if (may.torque[s][sign]) mask |= at_both_ends << (bound_of(0, s, false) + sign);
          if (may.voltage[s][sign]) mask |= at_both_ends << (bound_of(0, s, true) + sign);
        }
      }
    }
    bounds_[k] = mask;
    bounds_motors_ = bounds_motors_ || mask >> of_motors;
    first_bound_[k + 1] = first_bound_[k] + static_cast<std::size_t>(std::popcount(mask));
  }
  bound_states_.resize(first_bound_.back());
  duals_.resize(bound_states_.size() + 2 * n);
}

const SpeedEnvelope& SpeedSolver::envelope() {
  if (!envelope_) envelope_ = speed_envelope(grid_);
  return *envelope_;
}

void SpeedSolver::set_return(double down) {
  mean_slope_ = 0.5 * (grid_.electric.up + down);
  half_jump_ = 0.5 * (grid_.electric.up - down);
}

inline SpeedSolver::Torque SpeedSolver::torque(const CellLoad& w, double v, double q) const {
  if (w.full) return torque_in_full(*w.full, v, q);
  return {w.inertia * q + w.f0 + v * (w.f1 + v * w.f2), w.f1 + 2 * w.f2 * v, w.inertia, 2 * w.f2, 0, 0};
}

SpeedSolver::Torque SpeedSolver::torque_in_full(const WheelLoad& w, double v, double q) const {
  Torque r{};
  double way = 1, way_v = 0, way_vv = 0;  // of the wheel's direction
  if (w.creep != 0) {
    const double square = w.creep * w.creep, i = 1 / std::hypot(v, w.creep);
    way = v * i, way_v = square * i * i * i, way_vv = -3 * way_v * v * i * i;
  }
  double through = w.inertia * q + w.t0 + w.t_dry * way + v * (w.t1 + v * w.t2);
  double tv = w.t1 + 2 * w.t2 * v + w.t_dry * way_v, tvv = 2 * w.t2 + w.t_dry * way_vv;
  if (w.scrub != 0) {
    const double rise = std::tanh(v / w.scrub_speed), by_v = w.scrub * (1 - rise * rise) / w.scrub_speed;
    through += w.scrub * rise, tv += by_v, tvv -= 2 * rise * by_v / w.scrub_speed;
  }
  r.t = through + w.f0 + w.f_dry * way + v * (w.f1 + v * w.f2);
  r.tv = tv + w.f1 + 2 * w.f2 * v + w.f_dry * way_v;
  r.tq = w.inertia;
  r.tvv = tvv + 2 * w.f2 + w.f_dry * way_vv;
  if (w.gear != 0) {
    const double root = smooth_size(through);
    const double slope = through / root, bend = torque_smoothing_ * torque_smoothing_ / (root * root * root);
    r.t += w.gear * way * root;
    r.tv += w.gear * (way * slope * tv + way_v * root);
    r.tq += w.gear * way * slope * w.inertia;
    r.tvv += w.gear * (way * (slope * tvv + bend * tv * tv) + 2 * way_v * slope * tv + way_vv * root);
    r.tvq = w.gear * (way * bend * tv + way_v * slope) * w.inertia;
    r.tqq = w.gear * way * bend * w.inertia * w.inertia;
  }
  if (w.stribeck != 0) {
    const dynamics::StribeckSlopes curve =
        dynamics::stribeck_slopes(v / w.stribeck_speed, w.stribeck_exponent);
    r.t += w.stribeck * curve.value;
    r.tv += w.stribeck * curve.first / w.stribeck_speed;
    r.tvv += w.stribeck * curve.second / (w.stribeck_speed * w.stribeck_speed);
  }
  return r;
}

// visit(index, g, g0, g1, g00, g01, g11) for each bound g <= 0 of the cell, with its derivatives by z0 and
// z1.
template <class Visit>
void SpeedSolver::each_bound(std::size_t cell, const Node& first, const Node& last, Visit&& visit) const {
  const unsigned mask = bounds_[cell];
  const double p = 0.5 / grid_.step[cell], q = (last.z - first.z) * p;
  if (mask & bits(of_acceleration)) {
    const double a = 1 / grid_.acceleration_limit;
    visit(of_acceleration, q * a - 1, -p * a, p * a, 0.0, 0.0, 0.0);
    visit(of_acceleration + 1, -q * a - 1, p * a, -p * a, 0.0, 0.0, 0.0);
  }
  if (mask & bits(of_ceiling)) {
    const double a = 1 / grid_.ceiling[cell];
    visit(of_ceiling, first.z * a - 1, a, 0.0, 0.0, 0.0, 0.0);
    visit(of_floor, (floor_[cell] - first.z) * a, -a, 0.0, 0.0, 0.0, 0.0);
  }
  if (!(mask >> of_motors)) return;
  const double by_torque = 1 / grid_.torque_limit_nm, by_voltage = 1 / grid_.voltage_limit_v;
  for (const std::size_t end : {0u, 1u}) {
    if (!(mask >> bound_of(end, 0, false) & 0xffu)) continue;
    const Node& node = end == 0 ? first : last;
    const double v = node.v, vz = 0.5 * node.pace, vzz = -0.25 * node.pace * node.pace * node.pace;
    // a T + b v - 1, T of speed and acceleration.
    const auto bound = [&](unsigned j, double a, double b, const Torque& t) {
      const double by_v = a * t.tv + b, own = by_v * vz, by_q = a * t.tq * p;
      const double cross = a * t.tvq * vz * p, square = a * t.tqq * p * p,
                   bend = a * t.tvv * vz * vz + by_v * vzz;
      const double g = a * t.t + b * v - 1;
      if (end == 0)
        visit(j, g, own - by_q, by_q, bend - 2 * cross + square, cross - square, square);
      else
        visit(j, g, -by_q, own + by_q, square, -cross - square, bend + 2 * cross + square);
    };
    for (const std::size_t s : {0u, 1u}) {
      const unsigned of_torque = bound_of(end, s, false), of_voltage = bound_of(end, s, true);
      if (!(mask & (bits(of_torque) | bits(of_voltage)))) continue;
      const CellLoad& w = grid_.load(cell, end)[s];
      const Torque creeping = torque(w, v, q), rolling = w.full && w.full->creep != 0
                                                             ? torque_in_full(w.full->rolling(), v, q)
                                                             : creeping;
      const Electric& e = grid_.electric;
      const double emf = e.voltage_constant_v_s_rad * w.pace * by_voltage,
                   ohm = e.volts_per_nm[s] * by_voltage;
      for (const unsigned negative : {0u, 1u}) {
        const double sign = negative ? -1 : 1;
        const Torque& t = sign * rolling.t > sign * creeping.t ? rolling : creeping;
        if (mask >> (of_torque + negative) & 1u) bound(of_torque + negative, sign * by_torque, 0, t);
        if (mask >> (of_voltage + negative) & 1u) bound(of_voltage + negative, sign * ohm, sign * emf, t);
      }
    }
  }
}

void SpeedSolver::start_from(const std::vector<double>& z) {
  assert(z.size() == z_.size());
  for (const double share : {0.9999, 0.999, 0.99, 0.95}) {
    z_ = z;
    for (std::size_t k = 1; k < grid_.cells(); ++k) z_[k] = floor_[k] + share * (z[k] - floor_[k]);
    started_ = assemble(z_);
    if (started_) break;
  }
}

// Cost over the way of a cell, its derivatives, and its part of the kinks' gap.
SpeedSolver::Local SpeedSolver::local(std::size_t k) {
  const Electric& e = grid_.electric;
  Cell& c = cells_[k];
  const double v = c.v, q = c.q, i = 1 / v;
  Local l;
  l.f = idle_ * i, l.fv = -l.f * i, l.fvv = -2 * l.fv * i;
  l.dual_v = l.fv;
  for (std::size_t s : {0u, 1u}) {
    const CellLoad& w = grid_.load(k)[s];
    const Torque t = torque(w, v, q);
    const double rho = e.copper_w_n2_m2[s];
    double density = rho * t.t * i;                    // rho T/v
    double slope = 2 * density + e.back_emf * w.pace;  // d(energy)/dT
    double energy = (density + e.back_emf * w.pace) * t.t;
    double direct_v = -density * t.t * i;  // d(energy)/dv at constant T
    double bend = 2 * rho * i;             // d2/dT2
    double cross = -2 * density * i;       // d2/dT dv
    double direct_vv = 2 * density * t.t * i * i;
    if (e.brush_w_nm != 0) {
      const double root = smooth_size(t.t), y = e.brush_w_nm * root;
      const double y1 = e.brush_w_nm * t.t / root, excess = y - y1 * t.t;
      energy += y * i, slope += y1 * i, bend += excess / (root * root) * i;
      kink_gap_ += grid_.step[k] * e.up * excess * i;
      direct_v -= y * i * i, cross -= y1 * i * i, direct_vv += 2 * y * i * i * i;
    }
    const double ev = direct_v + slope * t.tv, eq = slope * t.tq;
    c.energy[s] = {energy, ev, eq, 0};
    const double evv = direct_vv + 2 * cross * t.tv + bend * t.tv * t.tv + slope * t.tvv;
    const double evq = cross * t.tq + bend * t.tv * t.tq + slope * t.tvq;
    const double eqq = bend * t.tq * t.tq + slope * t.tqq;
    double first = mean_slope_, second = 0;
    if (half_jump_ != 0) {
      const double size = std::sqrt(energy * energy + smoothing_ * smoothing_), r = 1 / size;
      c.energy[s].steepness = r;
      first += half_jump_ * energy * r;
      second = half_jump_ * std::max(0.0, 1 - c.kink[s] * energy * r) * r;
      l.f += half_jump_ * size;
    }
    l.f += mean_slope_ * energy;
    l.fv += first * ev, l.fq += first * eq;
    l.dual_v += (mean_slope_ + half_jump_ * c.kink[s]) * ev,
        l.dual_q += (mean_slope_ + half_jump_ * c.kink[s]) * eq;
    kink_gap_ += grid_.step[k] * half_jump_ * (std::fabs(energy) - c.kink[s] * energy);
    l.fvv += first * evv + second * ev * ev;
    l.fvq += first * evq + second * ev * eq;
    l.fqq += first * eqq + second * eq * eq;
  }
  return l;
}

// A profile with the present duals: its merit, and what the next step is found from; false outside the
// bounds.
bool SpeedSolver::assemble(const std::vector<double>& z) {
  cost_ = kink_gap_ = products_ = 0;
  Logarithms logarithms;
  const std::size_t n = grid_.cells();
  for (auto* v : {&by_z_, &push_, &stationarity_, &diagonal_, &off_, &magnitude_})
    std::fill(v->begin(), v->end(), 0.0);
  Node first(z[0]);
  for (std::size_t k = 0; k < n; ++k) {
    Cell& c = cells_[k];
    const Node last(z[k + 1]);
    const double h = grid_.step[k], p = 0.5 / h;
    c.v = 0.5 * (first.v + last.v), c.q = (last.z - first.z) * p;
    Local l = local(k);
    l.fv *= h, l.fq *= h, l.fvv *= h, l.fvq *= h, l.fqq *= h;
    // From (v, q) to (z0, z1).
    const double v0 = 0.25 * first.pace, v1 = 0.25 * last.pace, v00 = -0.5 * v0 * first.pace * first.pace,
                 v11 = -0.5 * v1 * last.pace * last.pace;
    c.by_z0 = v0, c.by_z1 = v1;
    cost_ += l.f * h;
    const double lv = l.dual_v * h, lq = l.dual_q * h;  // of the Lagrangian
    by_z_[k] += l.fv * v0 - l.fq * p, by_z_[k + 1] += l.fv * v1 + l.fq * p;
    stationarity_[k] += lv * v0 - lq * p, stationarity_[k + 1] += lv * v1 + lq * p;
    const double mixed = l.fvq * p;
    double d0 = l.fvv * v0 * v0 - 2 * mixed * v0 + l.fqq * p * p,
           d1 = l.fvv * v1 * v1 + 2 * mixed * v1 + l.fqq * p * p,
           d01 = l.fvv * v0 * v1 + mixed * (v0 - v1) - l.fqq * p * p;
    BoundState* state = bound_states_.data() + first_bound_[k];
    double least = 1, products = 0, push0 = 0, push1 = 0, along0 = 0, along1 = 0;
    each_bound(k, first, last,
               [&](unsigned j, double g, double g0, double g1, double g00, double g01, double g11) {
                 const double slack = -g, y = state->multiplier, product = y * slack, inverse = 1 / slack,
                              r0 = inverse * g0, r1 = inverse * g1;
                 *state++ = {y, slack, r0, r1, 0, j};
                 least = std::min(least, slack);
                 logarithms.add(slack);
                 products += product;
                 d0 += product * r0 * r0 + y * g00, d1 += product * r1 * r1 + y * g11,
                     d01 += product * r0 * r1 + y * g01;
                 push0 += r0, push1 += r1;
                 along0 += y * g0, along1 += y * g1;
               });
    if (!(least > 0)) return false;
    products_ += products;
    push_[k] += push0, push_[k + 1] += push1;
    stationarity_[k] += along0, stationarity_[k + 1] += along1;
    diagonal_[k] += d0 + l.fv * v00, diagonal_[k + 1] += d1 + l.fv * v11;
    off_[k] += d01;
    magnitude_[k] += std::fabs(d0) + std::fabs(l.fv * v00),
        magnitude_[k + 1] += std::fabs(d1) + std::fabs(l.fv * v11);
    first = last;
  }
  logarithms_ = logarithms.sum();
  return true;
}

// LDL' of the tridiagonal matrix over the inner nodes, a share of its diagonal's terms added; false when that
// is not positive definite.
bool SpeedSolver::factorise(double share) {
  for (std::size_t k = 1; k < grid_.cells(); ++k) {
    lower_[k] = k > 1 ? off_[k - 1] / pivot_[k - 1] : 0;
    pivot_[k] = diagonal_[k] + share * magnitude_[k] - (k > 1 ? lower_[k] * off_[k - 1] : 0);
    if (!(pivot_[k] > least_pivot * magnitude_[k])) return false;
  }
  return true;
}

void SpeedSolver::solve_step(const std::vector<double>& slope, std::vector<double>& step) const {
  const std::size_t n = grid_.cells();
  step[0] = step[n] = 0;
  step[1] = -slope[1];
  for (std::size_t k = 2; k < n; ++k) step[k] = -slope[k] - lower_[k] * step[k - 1];
  step[n - 1] /= pivot_[n - 1];
  for (std::size_t k = n - 1; k-- > 1;) step[k] = step[k] / pivot_[k] - lower_[k + 1] * step[k + 1];
}

// Changes the price of time so that the linearised duration after the step is the one that is due: one more
// unknown of Newton's method, whose row and column border the matrix. Returns how late z_ is.
double SpeedSolver::follow_price(double due_s) {
  const std::size_t n = grid_.cells();
  std::vector<double>&by_z = by_price_, &response = trial_;  // of the duration, and of the step to the price
  std::fill(by_z.begin(), by_z.end(), 0.0);
  double duration = 0, after = 0, fall = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const Cell& c = cells_[k];
    const double span = grid_.step[k] / c.v;
    duration += span;
    by_z[k] -= span / c.v * c.by_z0, by_z[k + 1] -= span / c.v * c.by_z1;
  }
  solve_step(by_z, response);
  for (std::size_t k = 1; k < n; ++k) after += by_z[k] * step_[k], fall -= by_z[k] * response[k];
  after += duration;
  const double change = std::clamp((after - due_s) / fall, -0.5 * idle_, idle_);
  idle_ += change;
  cost_ += change * duration;
  for (std::size_t k = 1; k < n; ++k) {
    const double slope = change * by_z[k];
    gradient_[k] += slope, slope_[k] += slope, stationarity_[k] += slope;
    step_[k] += change * response[k];
  }
  return duration - due_s;
}

// Between the slowest and the fastest profile of the envelope, near the cruising speed that balances idle
// power and viscosity.
std::vector<double> SpeedSolver::initial_point(std::optional<double> wanted) {
  const std::size_t n = grid_.cells();
  const Electric& e = grid_.electric;
  const std::vector<double>&fastest = envelope().fastest, &slowest = envelope().slowest;
  const double top = *std::max_element(fastest.begin(), fastest.end());
  double standing = idle_, viscous = 1e-300, losses = 0;
  for (std::size_t s : {0u, 1u}) {
    const dynamics::QuadraticPower p = motor_power(e, s, grid_.load(n / 2)[s].whole());
    standing += p.c0, viscous += std::max(0.0, p.c2), losses += p.c1;
  }
  // Without a limit on acceleration the fastest profile jumps; start on one with a copper loss equal to the
  // idle power.
  std::vector<double> gentle = fastest;
  if (!std::isfinite(grid_.acceleration_limit) && losses > 0)
    gentle = fastest_within(grid_, grid_.ceiling, std::sqrt(std::max(standing, 1e-3) / losses));
  std::vector<double> z(n + 1);
  z[0] = grid_.start, z[n] = grid_.end;
  double share = wanted.value_or(std::clamp(standing / viscous / top, 0.02, 0.85));
  for (int attempt = 0; attempt < 10; ++attempt) {
    for (std::size_t k = 1; k < n; ++k) {
      const double top_here = std::min(fastest[k], std::max(gentle[k], 2 * slowest[k]));
      z[k] = slowest[k] + share * (top_here - slowest[k]);
    }
    if (assemble(z)) return z;
    share = 0.7 * share + (attempt % 2 ? 0.0 : 0.29);
  }
  // Between two profiles there may be none that motors can follow: the fastest within a part of the limits.
  for (const double part : {0.9, 0.99, 0.999, 0.9999}) {
    SpeedGrid tight = grid_;
    for (std::size_t k = 1; k < n; ++k) tight.ceiling[k] *= part;
    for (double* limit : {&tight.acceleration_limit, &tight.torque_limit_nm, &tight.voltage_limit_v})
      *limit *= part;
    z = speed_envelope(tight).fastest;
    if (z[0] == grid_.start && z[n] == grid_.end && assemble(z)) break;
  }
  return z;
}

SpeedSolver::BarrierSchedule::BarrierSchedule(const SpeedGrid& grid, double bounds, double cost_j,
                                              double tolerance, double gap)
    : tolerance_(tolerance), bounds_(bounds), scale_(cost_j + 1e-300) {
  for (double h : grid.step) length_ += h;
  for (const CellLoad& w : grid.load(grid.cells() / 2))
    torque_nm_ = std::max(torque_nm_, std::fabs(w.f0) + 0.1 * std::fabs(w.inertia));
  mu_ = gap * scale_ / bounds_;
  finest_ = std::max(tolerance_, finest_gap) * scale_ / bounds_;
}

void SpeedSolver::BarrierSchedule::follow(double cost_j) {
  if (at_finest() || !(cost_j > 0)) return;
  scale_ = cost_j;
  finest_ = std::max(tolerance_, finest_gap) * scale_ / bounds_;
}

void SpeedSolver::BarrierSchedule::lower(double decrement, double step_length) {
  const bool solved = step_length > 0.9, quick = solved && decrement < mu_ * bounds_;
  if (at_finest() || !(solved || decrement < 10 * mu_ * bounds_)) return;
  mu_ = std::max(finest_, (quick ? quick_decrease : barrier_decrease) * mu_);
}

double SpeedSolver::BarrierSchedule::kink_width() const {
  // Smoothing changes the cost by at most twice the half jump times the width times the length.
  const double finest = 2 * tolerance_ * scale_ / length_;
  if (at_finest()) return finest;
  return std::max(finest, 0.3 * scale_ / length_ * std::sqrt(mu_ * bounds_ / scale_));
}

double SpeedSolver::BarrierSchedule::torque_width() const {
  return std::max(1e-4, std::sqrt(mu_ * bounds_ / scale_)) * torque_nm_;
}

void SpeedSolver::start_duals(double mu) {
  for (std::size_t k = 0; k < grid_.cells(); ++k) {
    BoundState* state = bound_states_.data() + first_bound_[k];
    each_bound(k, Node(z_[k]), Node(z_[k + 1]),
               [&](unsigned, double g, auto...) { state++->multiplier = mu / -g; });
    cells_[k].kink = {0, 0};
  }
}

// The matrix of the step, made positive definite if necessary; false if that fails.
bool SpeedSolver::regularise(double damping, bool& corrected) {
  corrected = false;
  for (double share = damping; !factorise(share);
       share = std::max(first_correction, correction_growth * share)) {
    corrected = true;
    if (share > 1e12) return false;
  }
  return true;
}

std::vector<double> SpeedSolver::cost_of_ends() {
  if (!bounds_motors_) return {};
  std::vector<double> cost(grid_.cells(), 0);
  for (std::size_t k = 0; k < grid_.cells(); ++k) {
    const auto motors = bounds_of(k).last(static_cast<std::size_t>(std::popcount(bounds_[k] >> of_motors)));
    for (std::size_t i = 0; i < motors.size() / 2; ++i) {
      const BoundState &near = motors[i], &far = motors[i + motors.size() / 2];
      const BoundState& fuller = near.slack < far.slack ? near : far;
      cost[k] += fuller.multiplier * 0.5 * std::fabs(near.slack - far.slack);
    }
  }
  return cost;
}

// Largest residual of the stationarity, each by its speed squared.
double SpeedSolver::stationarity_residual() const {
  double worst = 0;
  for (std::size_t k = 1; k < grid_.cells(); ++k)
    worst = std::max(worst, std::fabs(stationarity_[k]) * z_[k]);
  return worst;
}

// Longest step that keeps a share of every bound's slack, the motors' linearised: N&W (19.9).
double SpeedSolver::step_to_boundary() {
  double used = to_boundary;  // the largest share of a slack by the whole step
  for (std::size_t k = 0; k < grid_.cells(); ++k)
    for (const BoundState& b : bounds_of(k))
      used = std::max(used, b.used(step_[k], step_[k + 1]) * (b.index < of_motors ? 1 : 1 / linear_share));
  return to_boundary / used;
}

double SpeedSolver::decrement() const {
  double sum = 0;
  for (std::size_t k = 1; k < grid_.cells(); ++k) sum -= gradient_[k] * step_[k];
  return sum;
}

// Often a few bounds shorten the step of all cells. Those whose product s y a longer step would bring below a
// share of mu aim at more, and the step is solved for again with the same matrix, as long as it then promises
// a greater decrease (Gondzio, Comput. Optim. Appl. 6 (1996), sec. 3). Returns how long it can be.
double SpeedSolver::centre(double mu) {
  double longest = step_to_boundary(), promised = longest * decrement();
  for (int round = 0; round < most_corrections && longest < long_enough; ++round) {
    const double aim = std::min(1.0, 2 * longest + 0.1);
    raised_.clear();
    for (std::size_t k = 0; k < grid_.cells(); ++k) {
      for (BoundState& b : bounds_of(k)) {
        const double used = b.used(step_[k], step_[k + 1]), product = b.multiplier * b.slack;
        const double moved = (1 - aim * used) * (product + aim * (mu + b.raised + product * (used - 1)));
        if (moved >= least_product * mu) continue;
        const double lacking = least_product * mu - moved;
        b.raised += lacking;
        raised_.push_back({&b, lacking});
        slope_[k] += lacking * b.share0, slope_[k + 1] += lacking * b.share1;
      }
    }
    trial_ = step_;
    solve_step(slope_, step_);
    const double length = step_to_boundary(), now = length * decrement();
    if (!(now > promised)) {
      step_ = trial_;
      for (const auto& [bound, by] : raised_) bound->raised -= by;
      break;
    }
    longest = length, promised = now;
  }
  return longest;
}

// Backtracks until the barrier function falls enough; 0 when it does not. The accepted point is assembled, in
// trial_: the longest step with the smoothing of the barrier that follows it, which makes no cost greater; a
// shorter one keeps the barrier.
double SpeedSolver::line_search(double longest, double decrement, BarrierSchedule& barrier) {
  const double mu = barrier.mu(), from = merit(mu), noise = 1e-13 * barrier.scale();
  BarrierSchedule after = barrier;
  after.lower(decrement, longest);
  double length = longest;
  for (int halving = 0; halving < 30; ++halving) {
    smooth(after);
    for (std::size_t k = 0; k <= grid_.cells(); ++k) trial_[k] = z_[k] + length * step_[k];
    if (assemble(trial_) && merit(mu) <= from - sufficient_decrease * length * decrement + noise) {
      barrier = after;
      return length;
    }
    after = barrier;
    length *= halving < 2 ? 0.6 : 0.3;
  }
  smooth(barrier);
  return 0;
}

// Multipliers and the kinks' slopes follow their linearised equations along the step.
void SpeedSolver::update_duals(double mu) {
  auto before = duals_.begin();
  for (std::size_t k = 0; k < grid_.cells(); ++k) {
    Cell& c = cells_[k];
    const double dv = c.by_z0 * step_[k] + c.by_z1 * step_[k + 1];
    const double dq = (step_[k + 1] - step_[k]) / (2 * grid_.step[k]);
    for (BoundState& b : bounds_of(k)) {
      const double y = *before++ = b.multiplier;
      // It keeps a share of itself: one that ends at zero does not shorten the others' steps.
      b.multiplier =
          std::max((1 - to_boundary) * y, (mu + b.raised) / b.slack + y * b.used(step_[k], step_[k + 1]));
    }
    before = std::copy(c.kink.begin(), c.kink.end(), before);
    for (std::size_t s = 0; s < 2 && half_jump_ != 0; ++s) {
      const Energy& e = c.energy[s];
      const double change = (1 - c.kink[s] * e.j * e.steepness) * (e.by_v * dv + e.by_q * dq);
      c.kink[s] = std::clamp((e.j + change) * e.steepness, -1.0, 1.0);
    }
  }
}

void SpeedSolver::restore_duals() {
  auto before = duals_.begin();
  for (std::size_t k = 0; k < grid_.cells(); ++k) {
    for (BoundState& b : bounds_of(k)) b.multiplier = *before++;
    for (double& kink : cells_[k].kink) kink = *before++;
  }
}

// A bound binds where its multiplier outweighs its slack; `unit_j` is the scale of multipliers.
std::array<bool, bound_count> SpeedSolver::binding(double unit_j) const {
  std::array<bool, bound_count> binding{};
  for (const BoundState& b : bound_states_) {
    if (b.index == of_floor || b.slack > 1e-3 || b.multiplier * 1e-3 <= b.slack * unit_j) continue;
    const Bound bound = b.index < of_ceiling            ? Bound::acceleration
                        : b.index == of_ceiling         ? Bound::speed
                        : (b.index - of_motors) % 8 < 4 ? Bound::current
                                                        : Bound::voltage;
    binding[static_cast<std::size_t>(bound)] = true;
  }
  return binding;
}

std::vector<double> SpeedSolver::costs_j(const std::vector<double>& z, double price_w) {
  idle_ = grid_.electric.idle_w + price_w;
  smoothing_ = 0;
  std::vector<double> costs(grid_.cells());
  for (std::size_t k = 0; k < grid_.cells(); ++k) {
    cells_[k].v = mean_speed(z[k], z[k + 1]), cells_[k].q = (z[k + 1] - z[k]) / (2 * grid_.step[k]);
    costs[k] = local(k).f * grid_.step[k];
  }
  return costs;
}

SpeedSolution SpeedSolver::solve(double price_w, double tolerance, const std::stop_token& stop,
                                 const std::optional<Due>& due) {
  idle_ = grid_.electric.idle_w + price_w;
  // Where the price changes the cost by no more than a share of the gap, that barrier's profile is near.
  const auto nearest = std::find_if(way_.rbegin(), way_.rend(), [&](const Passed& p) {
    return p.gap > price_share * (due ? 1 : std::fabs(idle_ / last_idle_ - 1));
  });
  double gap = first_gap_warm;
  if (!started_ && nearest != way_.rend()) z_ = nearest->z, gap = nearest->gap, started_ = true;
  SpeedSolution best;
  if (started_) best = descend(price_w, gap, tolerance, stop, due);
  if (best.converged || stop.stop_requested() || !envelope().feasible) return best;
  std::vector<Passed> way;
  for (const std::optional<double> share : {std::optional<double>{}, {0.03}, {0.9}}) {
    if (share && !scrubs_) break;
    z_ = initial_point(share);
    // Braking that costs makes power concave in the torque. Its convex hull, free braking, leads near the
    // global optimum.
    set_return(std::max(0.0, grid_.electric.down));
    SpeedSolution found = descend(price_w, first_gap, tolerance, stop, due);
    set_return(grid_.electric.down);
    if (grid_.electric.down < 0) found = descend(found.price_w, first_gap_warm, tolerance, stop, due);
    if (best.z.empty() || (found.converged && (!best.converged || found.cost_j < best.cost_j)))
      best = std::move(found), way = std::move(way_);
  }
  way_ = std::move(way);
  if (best.z.empty()) z_ = envelope().fastest, finish(best, price_w);
  return best;
}

void SpeedSolver::finish(SpeedSolution& solution, double price_w) {
  solution.z = z_, solution.price_w = price_w;
  const std::vector<double> costs = costs_j(z_, price_w);
  solution.cost_j = std::accumulate(costs.begin(), costs.end(), 0.0);
  solution.duration_s = duration_of(grid_, z_);
}

// From z_, to the optimum near it.
SpeedSolution SpeedSolver::descend(double price_w, double gap, double tolerance, const std::stop_token& stop,
                                   const std::optional<Due>& due) {
  SpeedSolution solution;
  torque_smoothing_ = 0;
  started_ = false;
  way_.clear();
  z_.front() = grid_.start, z_.back() = grid_.end;
  finish(solution, price_w);
  BarrierSchedule barrier(grid_, static_cast<double>(bound_states_.size()), std::fabs(solution.cost_j),
                          tolerance, gap);
  smooth(barrier);
  start_duals(barrier.mu());
  if (!assemble(z_)) return {};
  double damping = 0;
  bool corrected = false;
  int settling = 0;
  for (int iteration = 0; iteration < most_iterations && !stop.stop_requested(); ++iteration) {
    solution.iterations = iteration + 1;
    // Tolerances follow the cost as it falls, so that the answer does not depend on where the search began.
    barrier.follow(cost_);
    for (std::size_t k = 0; k <= grid_.cells(); ++k)
      slope_[k] = gradient_[k] = by_z_[k] + barrier.mu() * push_[k];
    if (!regularise(damping, corrected)) break;
    solve_step(slope_, step_);
    const double idle = idle_, late_s = due ? follow_price(due->duration_s) : 0;
    if (due && idle_ > grid_.electric.idle_w + due->most_w) break;
    const double left = products_, allowed = tolerance * barrier.scale();
    solution.residual = stationarity_residual() / barrier.scale();
    if (barrier.at_finest() && left < 3 * allowed && decrement() < 0.3 * allowed &&
        !(due && std::fabs(late_s) > tolerance * due->duration_s) &&
        (solution.stationary() || ++settling > most_settling)) {
      solution.converged = true;
      solution.gap_j = left + kink_gap_;
      solution.ends_j = cost_of_ends();
      solution.convex = !scrubs_ && grid_.electric.down >= 0 && !corrected && damping == 0;
      break;
    }
    const double longest = centre(barrier.mu()), falls = decrement(), passed = barrier.gap();
    update_duals(barrier.mu());
    const double length = line_search(longest, falls, barrier);
    if (length == 0) {
      if (damping > 1e6) break;
      damping = std::max(first_damping, 10 * damping);
      restore_duals(), idle_ = idle;
      assemble(z_);
      continue;
    }
    std::swap(z_, trial_);
    if (length > 0.5) damping = damping > first_damping ? 0.1 * damping : 0;
    if (barrier.gap() < passed) way_.push_back({passed, z_});
  }
  if (!solution.converged) way_.clear();
  last_idle_ = idle_;
  solution.binding = binding(barrier.scale() / static_cast<double>(bound_states_.size()));
  finish(solution, idle_ - grid_.electric.idle_w);
  return solution;
}

}  // namespace joulecast::planning
