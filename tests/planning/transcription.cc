#include "tests/planning/transcription.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace joulecast::planning::test {
namespace {

class Motion {
 public:
  Motion(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run, const Limits& limits)
      : model_(model), run_(run), limits_(limits), half_track_m_(robot.kinematics.half_track_m),
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
    at.wheel_speed_rad_s = {(u + half_track_m_ * bend) * v / radius_m_, (u - half_track_m_ * bend) * v / radius_m_};
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
    double sum = f.accessories_w;
    for (std::size_t s : {0u, 1u}) {
      const double motor = f.voltage_v[s] * f.current_a[s];
      sum += 0.5 * (up + down) * motor + 0.5 * (up - down) * std::hypot(motor, width_w);
    }
    return sum;
  }

  // Largest of the motors' and the acceleration's shares of their limits.
  double motor_use(double v, double a) const {
    const auto f = flow(v, a);
    double use = 0;
    for (std::size_t s : {0u, 1u})
      use = std::max({use, std::fabs(f.current_a[s]) / limits_.current_a, std::fabs(f.voltage_v[s]) / limits_.voltage_v});
    return use;
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
    double energy_j, duration_s, excess;
  };
  Price price(std::size_t k, double v0, double v1, double width_w) const {
    const double t = 2 * (way_[k + 1] - way_[k]) / (v0 + v1), a = (v1 - v0) / t, mean = 0.5 * (v0 + v1);
    const double off = 0.5 * std::sqrt(0.6);
    double energy = 0;
    for (const auto& [place, weight] : {std::pair{-off, 5.0}, {0.0, 8.0}, {off, 5.0}})
      energy += weight / 18 * motion_.power_w(mean + place * (v1 - v0), a, width_w);
    const double excess = std::max({motion_.motor_use(mean, a), std::fabs(a) / motion_.most(),
                                    std::max(v0, v1) / motion_.top()}) - 1;
    return {energy * t, t, std::max(0.0, excess)};
  }
  double cost(std::size_t k, double v0, double v1, const Sharpness& s) const {
    const Price p = price(k, v0, v1, s.width_w);
    return p.energy_j + (price_ + s.penalty_w * p.excess * p.excess) * p.duration_s;
  }
  double cost(const std::vector<double>& v, const Sharpness& s) const {
    double sum = 0;
    for (std::size_t k = 0; k < cells(); ++k) sum += cost(k, v[k], v[k + 1], s);
    return sum;
  }

  // One damped Newton step; how much it gained.
  double improve(std::vector<double>& v, const Sharpness& s, double& damping) const {
    const std::size_t n = cells();
    std::vector<double> g(n + 1, 0), d(n + 1, 0), off(n + 1, 0), step(n + 1, 0), pivot(n + 1), trial;
    for (std::size_t k = 0; k < n; ++k) {
      const double h0 = 1e-4 * (v[k] + 1e-3), h1 = 1e-4 * (v[k + 1] + 1e-3);
      const auto f = [&](double i, double j) {
        return cost(k, std::max(0.0, v[k] + i * h0), std::max(0.0, v[k + 1] + j * h1), s);
      };
      const double here = f(0, 0), l = f(-1, 0), r = f(1, 0), b = f(0, -1), t = f(0, 1);
      if (k > 0) g[k] += (r - l) / (2 * h0), d[k] += (r - 2 * here + l) / (h0 * h0);
      if (k + 1 < n) g[k + 1] += (t - b) / (2 * h1), d[k + 1] += (t - 2 * here + b) / (h1 * h1);
      if (k > 0 && k + 1 < n) off[k] = (f(1, 1) - f(1, -1) - f(-1, 1) + f(-1, -1)) / (4 * h0 * h1);
    }
    const double before = cost(v, s);
    for (; damping < 1e12; damping = 10 * damping + 1e-9) {
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
      trial = v;
      for (std::size_t k = 1; k < n; ++k) trial[k] = std::clamp(v[k] + step[k], 0.3 * v[k], 3 * v[k]);
      const double after = cost(trial, s);
      if (after < before) {
        v = trial, damping *= 0.1;
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

TranscribedAnswer transcribed(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
                              const Limits& limits, double start_speed, double end_speed, double price_w,
                              int cells) {
  const Motion motion(robot, model, run, limits);
  const Grid grid(motion, run.length(), cells, price_w);
  // From a gentle ramp.
  std::vector<double> v;
  const double gentle = 0.1 * std::min(motion.most(), 10.0), ceiling = 0.5 * std::min(motion.top(), 10.0);
  for (std::size_t k = 0; k <= grid.cells(); ++k) {
    const double s = grid.way(k), rest = run.length() - s;
    v.push_back(std::sqrt(std::min({ceiling * ceiling, start_speed * start_speed + 2 * gentle * s,
                                    end_speed * end_speed + 2 * gentle * rest})));
  }
  v.front() = start_speed, v.back() = end_speed;
  const double idle = model.parameters().idle_power_w + price_w + 1;
  double damping = 1e-3;
  for (double sharp = 1; sharp < 1e6; sharp *= 4) {
    const Sharpness s{0.3 * idle / std::sqrt(sharp), 30 * idle * sharp};
    for (int k = 0; k < 60 && grid.improve(v, s, damping) > 1e-8 * grid.cost(v, s); ++k) continue;
  }
  TranscribedAnswer answer;
  for (std::size_t k = 0; k < grid.cells(); ++k) {
    const auto p = grid.price(k, v[k], v[k + 1], 0);
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
  // Speeds up to a peak and down again; what is left of the way at the peak.
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
