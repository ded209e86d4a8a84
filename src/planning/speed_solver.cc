#include "planning/speed_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "dynamics/stribeck_curve.h"

namespace joulecast::planning {
namespace {

double speed_of(double z0, double z1) {
  return 0.5 * (std::sqrt(z0) + std::sqrt(z1));
}

// Torque of a wheel without smoothing.
double torque_of(const WheelLoad& w, double v, double q) {
  const double through = w.inertia * q + w.t0 + v * (w.t1 + v * w.t2);
  double t = through + w.gear * std::fabs(through) + w.f0 + v * (w.f1 + v * w.f2);
  if (w.stribeck != 0) t += w.stribeck * dynamics::stribeck_curve(v / w.stribeck_speed, w.stribeck_exponent);
  return t;
}

bool motors_allow(const SpeedGrid& grid, std::size_t cell, double v, double q) {
  for (std::size_t s : {0u, 1u}) {
    const WheelLoad& w = grid.load(cell)[s];
    const double t = torque_of(w, v, q);
    if (std::fabs(t) > grid.torque_limit_nm * grid.share(cell)) return false;
    const Electric& e = grid.electric;
    const double volts =
        e.resistance_ohm[s] / e.torque_constant_nm_a * t + e.voltage_constant_v_s_rad * w.pace * v;
    if (std::fabs(volts) > grid.voltage_limit_v * grid.share(cell)) return false;
  }
  return true;
}

// The slowest profile whose acceleration stays within a bound; at rest in between where the way is long
// enough.
std::vector<double> slowest_profile(const SpeedGrid& grid, double acceleration) {
  const std::size_t n = grid.cells();
  std::vector<double> slowest(n + 1, 0);
  if (!std::isfinite(acceleration)) return slowest;
  double z = grid.start;
  for (std::size_t k = 0; k <= n; ++k) {
    slowest[k] = std::max(0.0, z);
    if (k < n) z -= 2 * grid.step[k] * acceleration;
  }
  z = grid.end;
  for (std::size_t k = n + 1; k-- > 0;) {
    slowest[k] = std::max(slowest[k], z);
    if (k > 0) z -= 2 * grid.step[k - 1] * acceleration;
  }
  return slowest;
}

}  // namespace

double duration_of(const SpeedGrid& grid, const std::vector<double>& z) {
  double sum = 0;
  for (std::size_t k = 0; k < grid.cells(); ++k) sum += grid.step[k] / speed_of(z[k], z[k + 1]);
  return sum;
}

SpeedEnvelope speed_envelope(const SpeedGrid& grid) {
  const std::size_t n = grid.cells();
  SpeedEnvelope e;
  e.fastest = grid.ceiling;
  e.fastest.front() = grid.start;
  e.fastest.back() = grid.end;

  const bool motors = std::isfinite(grid.torque_limit_nm) || std::isfinite(grid.voltage_limit_v);
  const auto allowed = [&](std::size_t cell, double z0, double z1) {
    return motors_allow(grid, cell, speed_of(z0, z1), (z1 - z0) / (2 * grid.step[cell]));
  };
  // Where a steady speed is already too much for the motors, the ceiling is lower.
  if (motors) {
    for (std::size_t k = 0; k <= n; ++k) {
      const std::size_t before = k > 0 ? k - 1 : 0, after = std::min(k, n - 1);
      const auto fits = [&](double z) {
        return motors_allow(grid, before, std::sqrt(z), 0) && motors_allow(grid, after, std::sqrt(z), 0);
      };
      if (fits(e.fastest[k])) continue;
      double low = 0, high = e.fastest[k];
      for (int i = 0; i < 40; ++i) {
        const double middle = 0.5 * (low + high);
        (fits(middle) ? low : high) = middle;
      }
      e.fastest[k] = low;
    }
  }
  // The largest z at the far end of a cell that can be reached by speeding up from the near end; bisection
  // only where motors bind. Slowing down is the other sweep's concern.
  const auto reach = [&](std::size_t cell, double near, double cap, bool forward) {
    if (cap <= near) return cap;
    const double top = std::isfinite(grid.acceleration_limit)
                           ? std::min(cap, near + 2 * grid.step[cell] * grid.acceleration_limit)
                           : cap;
    const auto fits = [&](double far) {
      return forward ? allowed(cell, near, far) : allowed(cell, far, near);
    };
    if (!motors || fits(top)) return top;
    const bool steady = fits(near);
    double low = steady ? near : 0, high = steady ? top : near;
    for (int k = 0; k < 40; ++k) {
      const double middle = 0.5 * (low + high);
      (fits(middle) ? low : high) = middle;
    }
    return low;
  };
  for (int sweep = 0; sweep < (motors ? 2 : 1); ++sweep) {
    for (std::size_t k = 0; k < n; ++k) e.fastest[k + 1] = reach(k, e.fastest[k], e.fastest[k + 1], true);
    for (std::size_t k = n; k-- > 0;) e.fastest[k] = reach(k, e.fastest[k + 1], e.fastest[k], false);
  }
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

SpeedSolver::SpeedSolver(const SpeedGrid& grid, const SpeedEnvelope& envelope)
    : grid_(grid), envelope_(envelope) {
  const std::size_t n = grid.cells();
  assert(n >= 2 && grid.ceiling.size() == n + 1);
  mean_slope_ = 0.5 * (grid.electric.up + grid.electric.down);
  half_jump_ = 0.5 * (grid.electric.up - grid.electric.down);
  cells_.resize(n);
  for (auto* v : {&z_, &trial_, &ceiling_multiplier_, &floor_multiplier_, &gradient_, &stationarity_,
                  &diagonal_, &off_, &magnitude_, &pivot_, &lower_, &step_}) {
    v->assign(n + 1, 0);
  }
  bounds_.assign(n, 0);
  bound_total_ = 2 * (n - 1);
  for (std::size_t k = 0; k < n; ++k) {
    std::uint16_t mask = 0;
    if (std::isfinite(grid.acceleration_limit)) mask = 3;
    // A bound is left out where no speed and acceleration inside the others can reach it.
    const double v = std::sqrt(std::max(envelope.fastest[k], envelope.fastest[k + 1]));
    for (std::size_t s : {0u, 1u}) {
      const WheelLoad& w = grid.load(k)[s];
      const double through = std::fabs(w.inertia) * grid.acceleration_limit + std::fabs(w.t0) +
                             v * (std::fabs(w.t1) + v * std::fabs(w.t2));
      const double most = through * (1 + std::fabs(w.gear)) + std::fabs(w.f0) +
                          v * (std::fabs(w.f1) + v * std::fabs(w.f2)) + std::fabs(w.stribeck);
      const Electric& e = grid.electric;
      const double volts = e.resistance_ohm[s] / e.torque_constant_nm_a * most +
                           e.voltage_constant_v_s_rad * std::fabs(w.pace) * v;
      if (std::isfinite(grid.torque_limit_nm) && !(most < 0.99 * grid.share(k) * grid.torque_limit_nm)) {
        mask = static_cast<std::uint16_t>(mask | (3u << (2 + 2 * s)));
      }
      if (std::isfinite(grid.voltage_limit_v) && !(volts < 0.99 * grid.share(k) * grid.voltage_limit_v)) {
        mask = static_cast<std::uint16_t>(mask | (3u << (6 + 2 * s)));
      }
    }
    bounds_[k] = mask;
    bounds_motors_ = bounds_motors_ || mask > 3;
    bound_total_ += static_cast<std::size_t>(__builtin_popcount(mask));
  }
}

SpeedSolver::Torque SpeedSolver::torque(const WheelLoad& w, double v, double q) const {
  Torque r{};
  const double through = w.inertia * q + w.t0 + v * (w.t1 + v * w.t2);
  const double tv = w.t1 + 2 * w.t2 * v, tvv = 2 * w.t2;
  r.t = through + w.f0 + v * (w.f1 + v * w.f2);
  r.tv = tv + w.f1 + 2 * w.f2 * v;
  r.tq = w.inertia;
  r.tvv = tvv + 2 * w.f2;
  if (w.gear != 0) {
    const double root = std::sqrt(through * through + gear_smoothing_ * gear_smoothing_);
    const double slope = through / root, bend = gear_smoothing_ * gear_smoothing_ / (root * root * root);
    r.t += w.gear * root;
    r.tv += w.gear * slope * tv;
    r.tq += w.gear * slope * w.inertia;
    r.tvv += w.gear * (slope * tvv + bend * tv * tv);
    r.tvq = w.gear * bend * tv * w.inertia;
    r.tqq = w.gear * bend * w.inertia * w.inertia;
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

double SpeedSolver::cost(std::size_t cell, double v, double q) const {
  const Electric& e = grid_.electric;
  double f = idle_ / v;
  for (std::size_t s : {0u, 1u}) {
    const WheelLoad& w = grid_.load(cell)[s];
    const Torque t = torque(w, v, q);
    double energy = (e.copper_w_n2_m2[s] * t.t / v + e.back_emf * w.pace) * t.t;
    if (e.brush_w_nm != 0) {
      energy += e.brush_w_nm * t.t * t.t / (v * std::sqrt(t.t * t.t + e.brush_width_nm * e.brush_width_nm));
    }
    f += mean_slope_ * energy;
    if (half_jump_ != 0) f += half_jump_ * std::sqrt(energy * energy + smoothing_ * smoothing_);
  }
  return f * grid_.step[cell];
}

// visit(index, g, gv, gq, gvv, gvq, gqq, scale) for each bound g <= 0 of the cell.
template <class Visit>
void SpeedSolver::each_bound(std::size_t cell, double v, double q, Visit&& visit) const {
  const unsigned mask = bounds_[cell];
  if (mask & 3u) {
    const double a = 1 / grid_.acceleration_limit;
    visit(0u, q * a - 1, 0.0, a, 0.0, 0.0, 0.0);
    visit(1u, -q * a - 1, 0.0, -a, 0.0, 0.0, 0.0);
  }
  if (mask < 4u) return;
  for (unsigned s : {0u, 1u}) {
    if (!(mask & ((3u << (2 + 2 * s)) | (3u << (6 + 2 * s))))) continue;
    const WheelLoad& w = grid_.load(cell)[s];
    const Torque t = torque(w, v, q);
    if (mask & (3u << (2 + 2 * s))) {
      for (double sign : {1.0, -1.0}) {
        const double a = sign / (grid_.torque_limit_nm * grid_.share(cell));
        visit(2 + 2 * s + (sign < 0), a * t.t - 1, a * t.tv, a * t.tq, a * t.tvv, a * t.tvq, a * t.tqq);
      }
    }
    if (mask & (3u << (6 + 2 * s))) {
      const Electric& e = grid_.electric;
      const double ohm = e.resistance_ohm[s] / e.torque_constant_nm_a,
                   emf = e.voltage_constant_v_s_rad * w.pace;
      for (double sign : {1.0, -1.0}) {
        const double a = sign / (grid_.voltage_limit_v * grid_.share(cell));
        visit(6 + 2 * s + (sign < 0), a * (ohm * t.t + emf * v) - 1, a * (ohm * t.tv + emf), a * ohm * t.tq,
              a * ohm * t.tvv, a * ohm * t.tvq, a * ohm * t.tqq);
      }
    }
  }
}

bool SpeedSolver::inside(const std::vector<double>& z) const {
  const std::size_t n = grid_.cells();
  for (std::size_t k = 1; k < n; ++k) {
    if (!(z[k] > 0 && z[k] < grid_.ceiling[k])) return false;
  }
  for (std::size_t k = 0; k < n; ++k) {
    bool ok = true;
    each_bound(k, speed_of(z[k], z[k + 1]), (z[k + 1] - z[k]) / (2 * grid_.step[k]),
               [&](unsigned, double g, auto...) { ok = ok && g < 0; });
    if (!ok) return false;
  }
  return true;
}

// Cost less mu times the logarithms of all slacks; infinite outside.
double SpeedSolver::merit(const std::vector<double>& z, double mu) const {
  const std::size_t n = grid_.cells();
  double sum = 0, product = 1, logs = 0;
  const auto barrier = [&](double slack) {
    product *= slack;
    if (product < 1e-200) logs += std::log(product), product = 1;
  };
  for (std::size_t k = 0; k < n; ++k) {
    const double v = speed_of(z[k], z[k + 1]), q = (z[k + 1] - z[k]) / (2 * grid_.step[k]);
    bool ok = true;
    each_bound(k, v, q, [&](unsigned, double g, auto...) {
      ok = ok && g < 0;
      if (ok) barrier(-g);
    });
    if (k > 0) {
      const double room = 1 - z[k] / grid_.ceiling[k];
      ok = ok && room > 0 && z[k] > 0;
      if (ok) barrier(room), barrier(std::min(1.0, z[k] / grid_.ceiling[k]));
    }
    if (!ok) return std::numeric_limits<double>::infinity();
    sum += cost(k, v, q);
  }
  return sum - mu * (logs + std::log(product));
}

void SpeedSolver::start_from(const std::vector<double>& z) {
  assert(z.size() == z_.size());
  trial_ = z;
  for (std::size_t k = 1; k < grid_.cells(); ++k) trial_[k] = std::min(z[k], 0.9999 * grid_.ceiling[k]);
  if (!inside(trial_)) return;
  z_ = trial_;
  started_ = true;
}

// Gradient and tridiagonal Hessian of the Lagrangian with the bounds condensed, at z_.
void SpeedSolver::assemble(double mu) {
  cost_here_ = kink_gap_ = 0;
  const std::size_t n = grid_.cells();
  const Electric& e = grid_.electric;
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  std::fill(stationarity_.begin(), stationarity_.end(), 0.0);
  std::fill(diagonal_.begin(), diagonal_.end(), 0.0);
  std::fill(off_.begin(), off_.end(), 0.0);
  std::fill(magnitude_.begin(), magnitude_.end(), 0.0);
  for (std::size_t k = 0; k < n; ++k) {
    Cell& c = cells_[k];
    const double z0 = z_[k], z1 = z_[k + 1], r0 = std::sqrt(z0), r1 = std::sqrt(z1), h = grid_.step[k];
    const double v = c.v = 0.5 * (r0 + r1), q = c.q = (z1 - z0) / (2 * h);
    Local l;
    l.f = idle_ / v, l.fv = -l.f / v, l.fvv = -2 * l.fv / v;
    double dual_v = l.fv, dual_q = 0;  // with the dual slope in place of phi's
    for (std::size_t s : {0u, 1u}) {
      const WheelLoad& w = grid_.load(k)[s];
      const Torque t = torque(w, v, q);
      const double rho = e.copper_w_n2_m2[s], i = 1 / v;
      double density = rho * t.t * i;                    // rho T/v
      double slope = 2 * density + e.back_emf * w.pace;  // d(energy)/dT
      double energy = (density + e.back_emf * w.pace) * t.t;
      double direct_v = -density * t.t * i;  // d(energy)/dv at constant T
      double bend = 2 * rho * i;             // d2/dT2
      double cross = -2 * density * i;       // d2/dT dv
      double direct_vv = 2 * density * t.t * i * i;
      if (e.brush_w_nm != 0) {
        const double width = e.brush_width_nm * e.brush_width_nm, root = std::sqrt(t.t * t.t + width);
        const double y = e.brush_w_nm * t.t * t.t / root;
        const double y1 = e.brush_w_nm * t.t * (t.t * t.t + 2 * width) / (root * root * root);
        const double y2 = e.brush_w_nm * width * (2 * width - t.t * t.t) / (root * root * root * root * root);
        energy += y * i, slope += y1 * i, bend += std::max(0.0, y2) * i;
        direct_v -= y * i * i, cross -= y1 * i * i, direct_vv += 2 * y * i * i * i;
      }
      const double ev = direct_v + slope * t.tv, eq = slope * t.tq;
      const double evv = direct_vv + 2 * cross * t.tv + bend * t.tv * t.tv + slope * t.tvv;
      const double evq = cross * t.tq + bend * t.tv * t.tq + slope * t.tvq;
      const double eqq = bend * t.tq * t.tq + slope * t.tqq;
      double first = mean_slope_, second = 0;
      if (half_jump_ != 0) {
        const double root = std::sqrt(energy * energy + smoothing_ * smoothing_);
        first += half_jump_ * energy / root;
        second = half_jump_ * std::max(0.0, 1 - c.kink[s] * energy / root) / root;
        l.f += half_jump_ * root;
      }
      l.f += mean_slope_ * energy;
      l.fv += first * ev, l.fq += first * eq;
      dual_v += (mean_slope_ + half_jump_ * c.kink[s]) * ev,
          dual_q += (mean_slope_ + half_jump_ * c.kink[s]) * eq;
      kink_gap_ += h * half_jump_ * (std::fabs(energy) - c.kink[s] * energy);
      l.fvv += first * evv + second * ev * ev;
      l.fvq += first * evq + second * ev * eq;
      l.fqq += first * eqq + second * eq * eq;
    }
    l.fv *= h, l.fq *= h, l.fvv *= h, l.fvq *= h, l.fqq *= h;
    // From (v, q) to (z0, z1).
    const double v0 = r0 > 0 ? 0.25 / r0 : 0, v1 = r1 > 0 ? 0.25 / r1 : 0;
    const double v00 = r0 > 0 ? -0.125 / (z0 * r0) : 0, v11 = r1 > 0 ? -0.125 / (z1 * r1) : 0, p = 0.5 / h;
    cost_here_ += l.f * h;
    double lv = dual_v * h, lq = dual_q * h;  // of the Lagrangian
    double hv = l.fv;                         // what multiplies the second derivative of v
    double bv = l.fv, bq = l.fq;              // of the barrier problem
    each_bound(k, v, q, [&](unsigned j, double g, double gv, double gq, double gvv, double gvq, double gqq) {
      const double slack = -g, y = c.multiplier[j];
      c.slack[j] = slack;
      const double weight = y / slack;
      l.fvv += weight * gv * gv + y * gvv;
      l.fvq += weight * gv * gq + y * gvq;
      l.fqq += weight * gq * gq + y * gqq;
      lv += y * gv, lq += y * gq, hv += y * gv;
      bv += mu / slack * gv, bq += mu / slack * gq;
    });
    gradient_[k] += bv * v0 - bq * p, gradient_[k + 1] += bv * v1 + bq * p;
    stationarity_[k] += lv * v0 - lq * p, stationarity_[k + 1] += lv * v1 + lq * p;
    const double mixed = l.fvq * p;
    const double d0 = l.fvv * v0 * v0 - 2 * mixed * v0 + l.fqq * p * p,
                 d1 = l.fvv * v1 * v1 + 2 * mixed * v1 + l.fqq * p * p;
    diagonal_[k] += d0 + hv * v00, diagonal_[k + 1] += d1 + hv * v11;
    off_[k] += l.fvv * v0 * v1 + mixed * (v0 - v1) - l.fqq * p * p;
    magnitude_[k] += std::fabs(d0) + std::fabs(hv * v00),
        magnitude_[k + 1] += std::fabs(d1) + std::fabs(hv * v11);
  }
  for (std::size_t k = 1; k < n; ++k) {
    const double a = 1 / grid_.ceiling[k], high = 1 - z_[k] * a, low = z_[k] * a;
    diagonal_[k] += a * a * (ceiling_multiplier_[k] / high + floor_multiplier_[k] / low);
    gradient_[k] += mu * a * (1 / high - 1 / low);
    stationarity_[k] += a * (ceiling_multiplier_[k] - floor_multiplier_[k]);
  }
}

// LDL' of the tridiagonal matrix over the inner nodes; false when it is not positive definite.
bool SpeedSolver::factorise() {
  const std::size_t n = grid_.cells();
  pivot_[1] = diagonal_[1];
  if (!(pivot_[1] > 1e-13 * magnitude_[1])) return false;
  for (std::size_t k = 2; k < n; ++k) {
    lower_[k] = off_[k - 1] / pivot_[k - 1];
    pivot_[k] = diagonal_[k] - lower_[k] * off_[k - 1];
    if (!(pivot_[k] > 1e-13 * magnitude_[k])) return false;
  }
  return true;
}

void SpeedSolver::solve_step() {
  const std::size_t n = grid_.cells();
  step_[0] = step_[n] = 0;
  step_[1] = -gradient_[1];
  for (std::size_t k = 2; k < n; ++k) step_[k] = -gradient_[k] - lower_[k] * step_[k - 1];
  step_[n - 1] /= pivot_[n - 1];
  for (std::size_t k = n - 1; k-- > 1;) step_[k] = step_[k] / pivot_[k] - lower_[k + 1] * step_[k + 1];
}

SpeedSolution SpeedSolver::solve(double price_w, double tolerance) {
  const std::size_t n = grid_.cells();
  const Electric& e = grid_.electric;
  idle_ = e.idle_w + price_w;
  SpeedSolution solution;

  const bool warm = started_;
  if (!started_) {
    // Both profiles of the envelope may press against the same bound; the lower one is drawn with less
    // acceleration.
    std::vector<double> slowest = envelope_.slowest;
    if (grid_.start > 0 || grid_.end > 0) {
      for (double part : {0.3, 0.6, 0.8, 0.9, 0.97, 0.99, 0.999}) {
        slowest = slowest_profile(grid_, part * grid_.acceleration_limit);
        bool below = true;
        for (std::size_t k = 1; k < n; ++k) below = below && slowest[k] < envelope_.fastest[k];
        if (below) break;
      }
    }
    // Between the slowest and the fastest profile, near the cruising speed that balances idle power and
    // viscosity.
    double top = 0;
    for (double z : envelope_.fastest) top = std::max(top, z);
    double standing = idle_, viscous = 1e-300, losses = 0;
    for (std::size_t s : {0u, 1u}) {
      const dynamics::QuadraticPower p = motor_power(e, s, grid_.load(n / 2)[s]);
      standing += p.c0, viscous += std::max(0.0, p.c2), losses += p.c1;
    }
    // Without a limit on acceleration the fastest profile jumps; start on one whose copper loss matches idle
    // power.
    std::vector<double> gentle(n + 1, std::numeric_limits<double>::infinity());
    if (!std::isfinite(grid_.acceleration_limit) && losses > 0) {
      const double a = std::sqrt(std::max(standing, 1e-3) / losses);
      double way = 0, rest = 0;
      for (double h : grid_.step) rest += h;
      for (std::size_t k = 0; k <= n; ++k) {
        gentle[k] = std::min(grid_.start + 2 * a * way, grid_.end + 2 * a * rest);
        if (k < n) way += grid_.step[k], rest -= grid_.step[k];
      }
    }
    double share = std::clamp(standing / viscous / top, 0.02, 0.85);
    for (int attempt = 0; attempt < 40; ++attempt) {
      for (std::size_t k = 1; k < n; ++k) {
        const double top_here = std::min(envelope_.fastest[k], std::max(gentle[k], 2 * slowest[k]));
        trial_[k] = slowest[k] + share * (top_here - slowest[k]);
      }
      trial_[0] = grid_.start, trial_[n] = grid_.end;
      if (inside(trial_)) break;
      share = 0.7 * share + (attempt % 2 ? 0.0 : 0.29);
    }
    z_ = trial_;
  }
  z_[0] = grid_.start, z_[n] = grid_.end;
  if (!inside(z_)) return solution;

  smoothing_ = 0, gear_smoothing_ = 0;
  double scale = std::fabs(merit(z_, 0)) + 1e-300;
  double length = 0;
  for (double h : grid_.step) length += h;
  double torque_scale = 0;
  for (std::size_t s : {0u, 1u}) {
    torque_scale =
        std::max(torque_scale, std::fabs(grid_.load(n / 2)[s].t0) + std::fabs(grid_.load(n / 2)[s].f0) +
                                   0.1 * std::fabs(grid_.load(n / 2)[s].inertia));
  }
  const auto count = static_cast<double>(bound_total_);
  double finest = std::max(tolerance, 1e-9) * scale / count;
  double mu = (warm ? 1e-3 : 3e-2) * scale / count;
  const auto smooth = [&] {
    // Twice the half jump times the width times the length is what smoothing can hide.
    const double finest_width = 2 * tolerance * scale / length;
    smoothing_ = std::max(finest_width, 0.3 * scale / length * std::sqrt(mu * count / scale));
    if (mu <= finest) smoothing_ = finest_width;
    gear_smoothing_ = std::max(1e-4, std::sqrt(mu * count / scale)) * torque_scale;
  };
  smooth();
  for (std::size_t k = 0; k < n; ++k) {
    Cell& c = cells_[k];
    const double v = speed_of(z_[k], z_[k + 1]), q = (z_[k + 1] - z_[k]) / (2 * grid_.step[k]);
    each_bound(k, v, q, [&](unsigned j, double g, auto...) { c.multiplier[j] = mu / -g; });
    c.kink = {0, 0};
  }
  for (std::size_t k = 1; k < n; ++k) {
    const double share = z_[k] / grid_.ceiling[k];
    ceiling_multiplier_[k] = mu / (1 - share), floor_multiplier_[k] = mu / share;
  }

  double damping = 0;
  bool corrected = false;
  for (int iteration = 0; iteration < 200; ++iteration) {
    solution.iterations = iteration + 1;
    assemble(mu);
    // Tolerances follow the cost as it falls, so that the answer does not depend on where the search began.
    if (mu > finest && cost_here_ > 0) {
      scale = cost_here_;
      finest = std::max(tolerance, 1e-9) * scale / count;
    }
    corrected = false;
    if (damping > 0) {
      for (std::size_t k = 1; k < n; ++k) diagonal_[k] += damping * magnitude_[k];
    }
    for (double add = std::max(1e-9, damping); !factorise(); add *= 8) {
      corrected = true;
      for (std::size_t k = 1; k < n; ++k) diagonal_[k] += add * magnitude_[k];
      if (add > 1e12) return solution;
    }
    solve_step();
    double decrement = 0;
    for (std::size_t k = 1; k < n; ++k) decrement -= gradient_[k] * step_[k];

    double gap = 0;
    for (std::size_t k = 1; k < n; ++k) {
      const double share = z_[k] / grid_.ceiling[k];
      gap += ceiling_multiplier_[k] * (1 - share) + floor_multiplier_[k] * share;
    }
    for (std::size_t k = 0; k < n; ++k) {
      for (unsigned j = 0; j < most_bounds; ++j) {
        if (bounds_[k] >> j & 1u) gap += cells_[k].multiplier[j] * cells_[k].slack[j];
      }
    }
    if (mu <= finest && gap < 3 * tolerance * scale &&
        decrement < (iteration < 60 ? 1e-3 : 0.3) * tolerance * scale) {
      solution.converged = true;
      solution.gap_j = gap + kink_gap_;
      double worst = 0, range = 0;
      for (std::size_t k = 1; k < n; ++k) {
        worst = std::max(worst, std::fabs(stationarity_[k]) * z_[k]);
        range = std::max(range, z_[k]);
      }
      solution.residual = worst / scale;
      solution.convex = !corrected && damping == 0;
      break;
    }

    // Longest step that keeps every linear bound and multiplier positive.
    double longest = 1, dual = 1;
    constexpr double keep = 0.995;
    const auto limit = [&](double value, double change, double& bound) {
      if (change < 0 && -change * bound > keep * value) bound = keep * value / -change;
    };
    for (std::size_t k = 1; k < n; ++k) {
      limit(z_[k], step_[k], longest);
      limit(grid_.ceiling[k] - z_[k], -step_[k], longest);
    }
    for (std::size_t k = 0; k < n; ++k) {
      if (!(bounds_[k] & 3u)) continue;
      const double dq = (step_[k + 1] - step_[k]) / (2 * grid_.step[k]);
      limit(grid_.acceleration_limit - cells_[k].q, -dq, longest);
      limit(grid_.acceleration_limit + cells_[k].q, dq, longest);
    }
    // Line search on the barrier function.
    const double here = merit(z_, mu);
    double length_taken = longest;
    bool accepted = false;
    for (int halving = 0; halving < 30; ++halving) {
      for (std::size_t k = 0; k <= n; ++k) trial_[k] = z_[k] + length_taken * step_[k];
      const double there = merit(trial_, mu);
      if (there <= here - 1e-4 * length_taken * decrement + 1e-13 * scale) {
        accepted = true;
        break;
      }
      length_taken *= halving < 2 ? 0.6 : 0.3;
    }
    if (!accepted) {
      if (damping > 1e6) return solution;
      damping = std::max(1e-4, 10 * damping);
      continue;
    }
    // Multipliers and slopes follow their linearised equations.
    for (std::size_t k = 0; k < n; ++k) {
      Cell& c = cells_[k];
      const double r0 = std::sqrt(z_[k]), r1 = std::sqrt(z_[k + 1]);
      const double dv = (r0 > 0 ? 0.25 / r0 * step_[k] : 0) + (r1 > 0 ? 0.25 / r1 * step_[k + 1] : 0);
      const double dq = (step_[k + 1] - step_[k]) / (2 * grid_.step[k]);
      each_bound(k, c.v, c.q, [&](unsigned j, double g, double gv, double gq, auto...) {
        const double slack = -g;
        const double change = mu / slack - c.multiplier[j] + c.multiplier[j] / slack * (gv * dv + gq * dq);
        c.slack[j] = change;  // reused until the next assembly
        limit(c.multiplier[j], change, dual);
      });
      if (half_jump_ != 0) {
        for (std::size_t s : {0u, 1u}) {
          const WheelLoad& w = grid_.load(k)[s];
          const Torque t = torque(w, c.v, c.q);
          const double density = e.copper_w_n2_m2[s] * t.t / c.v, slope = 2 * density + e.back_emf * w.pace;
          const double energy = (density + e.back_emf * w.pace) * t.t;
          const double change = (slope * t.tv - density * t.t / c.v) * dv + slope * t.tq * dq;
          const double root = std::sqrt(energy * energy + smoothing_ * smoothing_);
          c.kink[s] = std::clamp((energy + (1 - c.kink[s] * energy / root) * change) / root, -1.0, 1.0);
        }
      }
    }
    for (std::size_t k = 0; k < n; ++k) {
      for (unsigned j = 0; j < most_bounds; ++j) {
        if (bounds_[k] >> j & 1u) cells_[k].multiplier[j] += dual * cells_[k].slack[j];
      }
    }
    for (std::size_t k = 1; k < n; ++k) {
      const double a = 1 / grid_.ceiling[k], high = 1 - z_[k] * a, low = z_[k] * a, d = step_[k] * a;
      const double up = mu / high - ceiling_multiplier_[k] + ceiling_multiplier_[k] / high * d;
      const double down = mu / low - floor_multiplier_[k] - floor_multiplier_[k] / low * d;
      ceiling_multiplier_[k] = std::max(0.005 * ceiling_multiplier_[k], ceiling_multiplier_[k] + up);
      floor_multiplier_[k] = std::max(0.005 * floor_multiplier_[k], floor_multiplier_[k] + down);
    }
    std::swap(z_, trial_);
    if (length_taken > 0.5) damping = damping > 1e-4 ? 0.1 * damping : 0;
    if (mu > finest && (decrement < 10 * mu * count || length_taken > 0.9)) {
      mu = std::max(finest, (length_taken > 0.9 && decrement < mu * count ? 0.05 : 0.2) * mu);
      smooth();
    }
  }
  started_ = solution.converged;
  solution.z = z_;
  smoothing_ = 0;
  solution.cost_j = merit(z_, 0);
  solution.duration_s = duration_of(grid_, z_);

  // A bound binds where its multiplier outweighs its slack.
  const auto binds = [&](Bound b) { solution.binding[static_cast<std::size_t>(b)] = true; };
  for (std::size_t k = 0; k < n; ++k) {
    for (unsigned j = 0; j < most_bounds; ++j) {
      if (!(bounds_[k] >> j & 1u) || cells_[k].slack[j] > 1e-3) continue;
      if (cells_[k].multiplier[j] * 1e-3 > cells_[k].slack[j] * scale / count) {
        binds(j < 2 ? Bound::acceleration : j < 6 ? Bound::current : Bound::voltage);
      }
    }
  }
  for (std::size_t k = 1; k < n; ++k) {
    const double slack = 1 - z_[k] / grid_.ceiling[k];
    if (slack < 1e-3 && ceiling_multiplier_[k] * 1e-3 > slack * scale / count) binds(Bound::speed);
  }
  return solution;
}

}  // namespace joulecast::planning
