#include "tests/planning/transcription.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace joulecast::planning::test {
namespace {

class Motion {
 public:
  Motion(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
         const Limits& limits)
      : model_(model),
        run_(run),
        limits_(limits),
        half_track_m_(robot.kinematics.half_track_m),
        radius_m_(robot.kinematics.wheel_radius_m) {
    const double turn = run.turn == 0 ? std::fabs(run.knots[0].curvature_1_m) : 1;
    top_ = run.turn == 0 ? limits.speed_m_s : 1e3;
    if (turn > 0) top_ = std::min(top_, limits.yaw_rate_rad_s / turn);
    most_ = run.turn == 0 ? limits.acceleration_m_s2 : limits.acceleration_m_s2 / half_track_m_;
  }

  double top() const { return top_; }
  double most() const { return most_; }

  dynamics::PowerFlow<double> flow(double v, double a) const {
    const double bend = run_.turn == 0 ? run_.knots[0].curvature_1_m : run_.turn, u = run_.turn == 0 ? 1 : 0;
    dynamics::Instant at;
    at.wheel_speed_rad_s = {(u + half_track_m_ * bend) * v / radius_m_,
                            (u - half_track_m_ * bend) * v / radius_m_};
    at.wheel_acceleration_rad_s2 = {(u + half_track_m_ * bend) * a / radius_m_,
                                    (u - half_track_m_ * bend) * a / radius_m_};
    at.payload_kg = run_.payload_kg;
    return model_.flow(at);
  }

  // Battery power with the loss of braking power rounded over `width_w`.
  double power_w(double v, double a, double width_w) const {
    const auto f = flow(v, a);
    const auto& p = model_.parameters();
    const double up = 1 + p.driver_loss, down = 1 - p.unreturned - p.driver_loss;
    double sum = f.ledger[signals::Term::accessories];
    for (std::size_t s : {0u, 1u}) {
      const double motor = f.voltage_v[s] * f.current_a[s];
      sum += 0.5 * (up + down) * motor + 0.5 * (up - down) * std::hypot(motor, width_w);
    }
    return sum;
  }

  // Shares that currents and voltages have of their limits.
  std::array<double, 4> motor_uses(double v, double a) const {
    const auto f = flow(v, a);
    return {std::fabs(f.current_a[0]) / limits_.current_a, std::fabs(f.current_a[1]) / limits_.current_a,
            std::fabs(f.voltage_v[0]) / limits_.voltage_v, std::fabs(f.voltage_v[1]) / limits_.voltage_v};
  }
  double motor_use(double v, double a) const {
    const auto uses = motor_uses(v, a);
    return *std::max_element(uses.begin(), uses.end());
  }

 private:
  const dynamics::DriveModel& model_;
  const Run& run_;
  const Limits& limits_;
  double half_track_m_, radius_m_, top_ = 0, most_ = 0;
};

struct Sharpness {
  double width_w, penalty_w;
};

class Grid {
 public:
  Grid(const Motion& motion, double length, int cells, double price_w) : motion_(motion), price_(price_w) {
    for (int k = 0; k <= cells; ++k) {
      const double x = static_cast<double>(k) / cells;
      way_.push_back(length * x * x * (3 - 2 * x));
    }
  }

  std::size_t cells() const { return way_.size() - 1; }
  double way(std::size_t k) const { return way_[k]; }

  struct Price {
    double energy_j, duration_s, excess, squares;  // of the excesses
  };
  Price price(std::size_t k, double v0, double v1, double width_w) const {
    const double t = 2 * (way_[k + 1] - way_[k]) / (v0 + v1), a = (v1 - v0) / t, mean = 0.5 * (v0 + v1);
    const double off = 0.5 * std::sqrt(0.6);
    double energy = 0;
    for (const auto& [place, weight] : {std::pair{-off, 5.0}, {0.0, 8.0}, {off, 5.0}})
      energy += weight / 18 * motion_.power_w(mean + place * (v1 - v0), a, width_w);
    Price p{energy * t, t, 0, 0};
    const auto uses = motion_.motor_uses(mean, a);
    for (const double use :
         {uses[0], uses[1], uses[2], uses[3], std::fabs(a) / motion_.most(), v1 / motion_.top()}) {
      const double over = std::max(0.0, use - 1);
      p.excess = std::max(p.excess, over), p.squares += over * over;
    }
    return p;
  }
  double cost(std::size_t k, double z0, double z1, const Sharpness& s) const {
    const Price p = price(k, std::sqrt(std::max(0.0, z0)), std::sqrt(std::max(0.0, z1)), s.width_w);
    return p.energy_j + (price_ + s.penalty_w * p.squares) * p.duration_s;
  }
  double cost(const std::vector<double>& z, const Sharpness& s) const {
    double sum = 0;
    for (std::size_t k = 0; k < cells(); ++k) sum += cost(k, z[k], z[k + 1], s);
    return sum;
  }

  // One damped Newton step in the squared speeds, in which the problem is convex; how much it gained.
  double improve(std::vector<double>& z, const Sharpness& s, double& damping) const {
    const std::size_t n = cells();
    std::vector<double> g(n + 1, 0), d(n + 1, 0), off(n + 1, 0), step(n + 1, 0), pivot(n + 1, 0), trial(z);
    for (std::size_t k = 0; k < n; ++k) {
      const double h0 = 1e-4 * z[k] + 1e-9, h1 = 1e-4 * z[k + 1] + 1e-9;
      const auto f = [&](double i, double j) { return cost(k, z[k] + i * h0, z[k + 1] + j * h1, s); };
      const double here = f(0, 0), l = f(-1, 0), r = f(1, 0), b = f(0, -1), t = f(0, 1);
      if (k > 0) g[k] += (r - l) / (2 * h0), d[k] += (r - 2 * here + l) / (h0 * h0);
      if (k + 1 < n) g[k + 1] += (t - b) / (2 * h1), d[k + 1] += (t - 2 * here + b) / (h1 * h1);
      if (k > 0 && k + 1 < n) off[k] = (f(1, 1) - f(1, -1) - f(-1, 1) + f(-1, -1)) / (4 * h0 * h1);
    }
    const double before = cost(z, s);
    for (; damping < 1e12; damping = 10 * damping + 1e-7) {
      bool definite = true;
      double l = 0;
      for (std::size_t k = 1; k < n; ++k) {
        const double own = d[k] + damping * (std::fabs(d[k]) + 1e-9);
        l = k > 1 ? off[k - 1] / pivot[k - 1] : 0;
        pivot[k] = own - (k > 1 ? l * off[k - 1] : 0);
        step[k] = -g[k] - (k > 1 ? l * step[k - 1] : 0);
        definite = definite && pivot[k] > 0;
      }
      if (!definite) continue;
      step[n - 1] /= pivot[n - 1];
      for (std::size_t k = n - 1; k-- > 1;) step[k] = (step[k] - off[k] * step[k + 1]) / pivot[k];
      trial = z;
      for (std::size_t k = 1; k < n; ++k) trial[k] = std::clamp(z[k] + step[k], 0.2 * z[k], 5 * z[k]);
      const double after = cost(trial, s);
      if (after < before) {
        z = trial, damping *= 0.1;
        return before - after;
      }
    }
    damping = 1e-6;
    return 0;
  }

 private:
  const Motion& motion_;
  double price_;
  std::vector<double> way_;
};

}  // namespace

TranscribedAnswer transcribed(const robot::RobotModel& robot, const dynamics::DriveModel& model,
                              const Run& run, const Limits& limits, double start_speed, double end_speed,
                              double price_w, int cells) {
  const Motion motion(robot, model, run, limits);
  const Grid grid(motion, run.length(), cells, price_w);
  // From a gentle ramp.
  std::vector<double> z;
  const double gentle = 0.1 * std::min(motion.most(), 10.0), ceiling = 0.5 * std::min(motion.top(), 10.0);
  for (std::size_t k = 0; k <= grid.cells(); ++k) {
    const double s = grid.way(k), rest = run.length() - s;
    z.push_back(std::min({ceiling * ceiling, start_speed * start_speed + 2 * gentle * s,
                          end_speed * end_speed + 2 * gentle * rest}));
  }
  z.front() = start_speed * start_speed, z.back() = end_speed * end_speed;
  const double idle = model.parameters().idle_power_w + price_w + 1;
  double damping = 1e-3;
  for (double sharp = 1; sharp < 3e6; sharp *= 6) {
    const Sharpness s{0.3 * idle / std::sqrt(sharp), 30 * idle * sharp};
    int still = 0;  // steps that gained nothing worth mentioning
    for (int k = 0; k < 200 && still < 3; ++k)
      still = grid.improve(z, s, damping) > 1e-9 * grid.cost(z, s) ? 0 : still + 1;
  }
  TranscribedAnswer answer;
  for (std::size_t k = 0; k < grid.cells(); ++k) {
    const auto p = grid.price(k, std::sqrt(z[k]), std::sqrt(z[k + 1]), 0);
    answer.energy_j += p.energy_j, answer.duration_s += p.duration_s;
    answer.excess = std::max(answer.excess, p.excess);
  }
  answer.cost_j = answer.energy_j + price_w * answer.duration_s;
  return answer;
}

double least_time_s(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
                    const Limits& limits) {
  const Motion motion(robot, model, run, limits);
  // Dry friction is there from the first instant, which the drive model smooths through standstill.
  const double moving = 0.2 * robot.kinematics.wheel_radius_m;
  const auto greatest = [&](double v, double sign) {
    const double speed = std::max(v, run.turn == 0 ? moving : moving / robot.kinematics.half_track_m);
    if (motion.motor_use(speed, sign * motion.most()) <= 1) return motion.most();
    double low = 0, high = motion.most();
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (motion.motor_use(speed, sign * middle) <= 1 ? low : high) = middle;
    }
    return low;
  };
  constexpr int parts = 4000;
  std::vector<double> up, down;
  double top = motion.top();
  while (motion.motor_use(top, 0) > 1) top *= 0.999;
  for (int k = 0; k < parts; ++k) {
    const double v = top * (k + 0.5) / parts;
    up.push_back(greatest(v, 1)), down.push_back(greatest(v, -1));
  }
  // Speeds up to a peak and down again; the rest of the way is driven at the peak.
  double time = 0, way = 0;
  const double dv = top / parts;
  for (std::size_t k = 0; k < up.size(); ++k) {
    const double v = dv * (static_cast<double>(k) + 0.5);
    const double more_s = dv / up[k] + dv / down[k], more = v * more_s;
    if (!(up[k] > 0) || way + more > run.length()) {
      return time + (run.length() - way) / v;
    }
    time += more_s, way += more;
  }
  return time + (run.length() - way) / top;
}

}  // namespace joulecast::planning::test
