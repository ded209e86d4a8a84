#include "tests/planning/reference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace joulecast::planning::test {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();

class Table {
 public:
  Table(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
        const Limits& limits, double price_w, int stations)
      : robot_(robot), model_(model), run_(run), limits_(limits), price_(price_w) {
    // Stations denser at the ends; on curves, where the curvature varies, half of them evenly.
    const bool curved = run.turn == 0 && !run.constant_curvature();
    for (int k = 0; k <= stations; ++k) {
      const double x = static_cast<double>(k) / stations, ends = 0.5 * (1 - std::cos(std::numbers::pi * x));
      way_.push_back(run.length() * (curved ? 0.5 * x + 0.5 * ends : ends));
    }
    if (!run.constant_curvature()) {
      for (const Knot& k : run.knots) {
        // Corners of the curvature become stations.
        if (run.knots.size() < 60) way_.push_back(k.way);
      }
      std::sort(way_.begin(), way_.end());
      std::vector<double> apart{0};
      for (double w : way_) {
        if (w > apart.back() + 1e-4 * run.length()) apart.push_back(w);
      }
      apart.back() = run.length();
      way_ = apart;
    }
  }

  int cells() const { return static_cast<int>(way_.size()) - 1; }
  double way(int k) const { return way_[static_cast<std::size_t>(k)]; }

  double top_speed(int k) const {
    const double turn = run_.turn == 0 ? std::fabs(run_.at(way(k)).curvature_1_m) : 1;
    double v = run_.turn == 0 ? limits_.speed_m_s : never;
    if (turn > 0) v = std::min(v, limits_.yaw_rate_rad_s / turn);
    return std::min(v, run_.turn == 0 ? 4.0 : 8.0);
  }

  struct Price {
    double energy = 0, time = 0, excess = 0;
  };

  // Constant acceleration from v0 to v1 over cell k, three Gauss points in time.
  Price price(int k, double v0, double v1) const {
    Price p;
    const double h = way(k + 1) - way(k);
    if (v0 + v1 <= 0) return {never, never, 0};
    p.time = 2 * h / (v0 + v1);
    const double a = (v1 - v0) / p.time;
    const double most = run_.turn == 0 ? limits_.acceleration_m_s2
                                       : limits_.acceleration_m_s2 / robot_.kinematics.half_track_m;
    p.excess = std::max(0.0, std::fabs(a) / most - 1);
    const double l = robot_.kinematics.half_track_m, r = robot_.kinematics.wheel_radius_m;
    static const double node[2] = {0.2113248654051871, 0.7886751345948129};
    for (double f : node) {
      const double t = f * p.time, v = v0 + a * t, s = way(k) + v0 * t + a * t * t / 2;
      const Knot here = run_.at(s);
      const double e = 1e-5 * run_.length();
      const double bend = (run_.at(s + e).curvature_1_m - run_.at(s - e).curvature_1_m) / (2 * e);
      const double yaw = run_.turn == 0 ? here.curvature_1_m * v : run_.turn * v;
      const double yaw_rate = run_.turn == 0 ? here.curvature_1_m * a + bend * v * v : run_.turn * a;
      const double u = run_.turn == 0 ? v : 0, du = run_.turn == 0 ? a : 0;
      dynamics::Instant at;
      at.wheel_speed_rad_s = {(u + l * yaw) / r, (u - l * yaw) / r};
      at.wheel_acceleration_rad_s2 = {(du + l * yaw_rate) / r, (du - l * yaw_rate) / r};
      at.payload_kg = run_.payload_kg;
      at.x_m = here.pose.x_m, at.y_m = here.pose.y_m, at.heading_rad = here.pose.heading_rad;
      const auto flow = model_.flow(at);
      p.energy += 0.5 * p.time * flow.battery_power_w;
      for (std::size_t s2 : {0u, 1u}) {
        p.excess = std::max(p.excess, std::fabs(flow.current_a[s2]) / limits_.current_a - 1);
        p.excess = std::max(p.excess, std::fabs(flow.voltage_v[s2]) / limits_.voltage_v - 1);
      }
    }
    return p;
  }

  double cost(int k, double v0, double v1, double penalty_w) const {
    const Price p = price(k, v0, v1);
    return p.energy + price_ * p.time + penalty_w * p.time * p.excess;
  }

 private:
  const robot::RobotModel& robot_;
  const dynamics::DriveModel& model_;
  const Run& run_;
  const Limits& limits_;
  double price_;
  std::vector<double> way_;
};

}  // namespace

ReferenceAnswer reference(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
                          const Limits& limits, double start_speed, double end_speed, double price_w,
                          int stations) {
  // Varying curvature needs more of them.
  const bool varies = !run.constant_curvature();
  const Table table(robot, model, run, limits, price_w, varies ? 2 * stations : stations);
  const int n = table.cells();
  const auto size = static_cast<std::size_t>(n) + 1;
  std::vector<double> centre(size), width(size), best(size);
  for (int k = 0; k <= n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    width[i] = table.top_speed(k) / 2;
    centre[i] = width[i];
  }
  double penalty = 200 * (price_w + model.parameters().idle_power_w + 100);
  for (int round = 0; round < 60; ++round) {
    const int levels = round == 0 ? 33 : round < 6 ? 13 : 7;
    const auto level = [&](int k, int j) {
      if (k == 0) return start_speed;
      if (k == n) return end_speed;
      const auto i = static_cast<std::size_t>(k);
      const double v = centre[i] + width[i] * (2.0 * j / (levels - 1) - 1);
      return std::clamp(v, 1e-3 * table.top_speed(k), table.top_speed(k));
    };
    std::vector<std::vector<int>> from(size, std::vector<int>(static_cast<std::size_t>(levels), 0));
    std::vector<double> value{0}, next;
    for (int k = 0; k < n; ++k) {
      const int here = k == 0 ? 1 : levels, there = k + 1 == n ? 1 : levels;
      next.assign(static_cast<std::size_t>(there), never);
      for (int j = 0; j < there; ++j) {
        for (int i = 0; i < here; ++i) {
          const double c =
              value[static_cast<std::size_t>(i)] + table.cost(k, level(k, i), level(k + 1, j), penalty);
          if (c < next[static_cast<std::size_t>(j)]) {
            next[static_cast<std::size_t>(j)] = c;
            from[static_cast<std::size_t>(k) + 1][static_cast<std::size_t>(j)] = i;
          }
        }
      }
      value = next;
    }
    int j = 0;
    for (int k = n; k >= 0; --k) {
      best[static_cast<std::size_t>(k)] = level(k, j);
      if (k > 0) j = from[static_cast<std::size_t>(k)][static_cast<std::size_t>(j)];
    }
    double moved = 0;
    for (std::size_t k = 1; k + 1 < size; ++k)
      moved = std::max(moved, std::fabs(best[k] - centre[k]) / width[k]);
    centre = best;
    // Draw in only where the best profile left the edges alone.
    const double shrink = round == 0 ? 0.35 : moved > 0.9 ? 0.92 : 0.72;
    for (double& w : width) w *= shrink;
  }
  ReferenceAnswer answer;
  for (int k = 0; k < n; ++k) {
    const auto p = table.price(k, best[static_cast<std::size_t>(k)], best[static_cast<std::size_t>(k) + 1]);
    answer.energy_j += p.energy;
    answer.duration_s += p.time;
    answer.excess = std::max(answer.excess, p.excess);
  }
  answer.cost_j = answer.energy_j + price_w * answer.duration_s;
  return answer;
}

}  // namespace joulecast::planning::test
