#include "planning/speed_grid.h"

#include <algorithm>
#include <cmath>
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

}  // namespace joulecast::planning
