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
    // Sharp corners of the curvature are stations: torque jumps there, and acceleration with it.
    for (std::size_t k = 1; k + 1 < run.knots.size(); ++k) {
      const auto slope = [&](std::size_t i) {
        return (run.knots[i].curvature_1_m - run.knots[i - 1].curvature_1_m) /
               (run.knots[i].way - run.knots[i - 1].way);
      };
      if (std::fabs(slope(k + 1) - slope(k)) < 1) continue;
      const auto near = std::min_element(way_.begin() + 1, way_.end() - 1, [&](double a, double b) {
        return std::fabs(a - run.knots[k].way) < std::fabs(b - run.knots[k].way);
      });
      *near = run.knots[k].way;
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

  // Reached from the ends with half of the limit of acceleration; no motor binds where there is one.
  double least_speed(int k) const {
    const double rises = limits_.acceleration_m_s2, least = limits_.least_speed_m_s;
    if (least == 0 || run_.turn != 0) return 1e-3 * top_speed(k);
    return std::max(1e-3 * top_speed(k), std::min({least, std::sqrt(rises * way(k)),
                                                   std::sqrt(rises * (run_.length() - way(k)))}));
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

// One round: the best profile through `levels` speeds round `centre` at every station. Returns how far it
// moved, in widths.
double improve(const Table& table, std::vector<double>& centre, const std::vector<double>& width, int levels,
               double penalty_w) {
  const int n = table.cells();
  const auto level = [&](int k, int j) {
    const auto i = static_cast<std::size_t>(k);
    if (k == 0 || k == n) return centre[i];
    const double v = centre[i] + width[i] * (2.0 * j / (levels - 1) - 1);
    return std::clamp(v, table.least_speed(k), table.top_speed(k));
  };
  std::vector<std::vector<int>> from(centre.size(), std::vector<int>(static_cast<std::size_t>(levels), 0));
  std::vector<double> value{0}, next;
  for (int k = 0; k < n; ++k) {
    const int here = k == 0 ? 1 : levels, there = k + 1 == n ? 1 : levels;
    next.assign(static_cast<std::size_t>(there), never);
    for (int j = 0; j < there; ++j) {
      const auto to = static_cast<std::size_t>(j);
      for (int i = 0; i < here; ++i) {
        const double c =
            value[static_cast<std::size_t>(i)] + table.cost(k, level(k, i), level(k + 1, j), penalty_w);
        if (c < next[to]) next[to] = c, from[static_cast<std::size_t>(k) + 1][to] = i;
      }
    }
    value = next;
  }
  double moved = 0;
  std::vector<double> best(centre.size());
  for (int k = n, j = 0; k >= 0; --k) {
    const auto i = static_cast<std::size_t>(k);
    best[i] = level(k, j);
    if (k > 0) j = from[i][static_cast<std::size_t>(j)];
    if (k > 0 && k < n) moved = std::max(moved, std::fabs(best[i] - centre[i]) / width[i]);
  }
  centre = best;
  return moved;
}

}  // namespace

ReferenceAnswer reference(const robot::RobotModel& robot, const dynamics::DriveModel& model, const Run& run,
                          const Limits& limits, double start_speed, double end_speed, double price_w,
                          int stations) {
  const double penalty_w = 200 * (price_w + model.parameters().idle_power_w + 100);
  // Nested tables: each starts from the coarser one's profile. Varying curvature needs one more.
  const int tables = run.constant_curvature() ? 2 : 3;
  std::vector<double> centre, way;
  ReferenceAnswer answer;
  for (int t = 0; t < tables; ++t) {
    const Table table(robot, model, run, limits, price_w, stations << t);
    const int n = table.cells();
    std::vector<double> speed, width, here;
    for (int k = 0; k <= n; ++k) {
      here.push_back(table.way(k));
      const double top = table.top_speed(k);
      width.push_back((t == 0 ? 0.5 : 0.06) * top);
      if (t == 0) {
        speed.push_back(0.5 * top);
      } else {
        const auto above = std::upper_bound(way.begin() + 1, way.end() - 1, here.back()) - way.begin();
        const auto b = static_cast<std::size_t>(above), a = b - 1;
        const double f = (here.back() - way[a]) / (way[b] - way[a]);
        speed.push_back(
            std::sqrt(std::max(0.0, (1 - f) * centre[a] * centre[a] + f * centre[b] * centre[b])));
      }
    }
    speed.front() = start_speed, speed.back() = end_speed;
    for (int round = 0; round < (t == 0 ? 60 : 40); ++round) {
      const int levels = round == 0 && t == 0 ? 33 : round < 5 ? 13 : 7;
      const double moved = improve(table, speed, width, levels, penalty_w);
      // Draw in only where the best profile left the edges alone.
      const double shrink = round == 0 && t == 0 ? 0.35 : moved > 0.9 ? 0.93 : 0.75;
      for (double& w : width) w *= shrink;
    }
    centre = speed, way = here;
    answer = {};
    for (int k = 0; k < n; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const auto p = table.price(k, centre[i], centre[i + 1]);
      answer.energy_j += p.energy;
      answer.duration_s += p.time;
      answer.excess = std::max(answer.excess, p.excess);
    }
    answer.cost_j = answer.energy_j + price_w * answer.duration_s;
  }
  return answer;
}

}  // namespace joulecast::planning::test
