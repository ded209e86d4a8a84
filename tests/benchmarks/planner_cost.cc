// Cost of planning, energy saved, and a comparison with a scheduler's usual energy model, in one run.
//   planner_cost                  everything
//   planner_cost --straight N     N straight solves only, to count instructions
//   planner_cost --limited N      likewise with speed and acceleration limits that bind
//   planner_cost --deadlines N    deadlines of paths of up to N segments
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "planning/baseline.h"
#include "planning/cost_table.h"
#include "planning/line.h"
#include "planning/planner.h"
#include "tests/benchmarks/rmf_motion.h"
#include "tests/planning/random_problem.h"
#include "tests/study/ramp/ramp.h"
#include "tests/support/straight_power.h"

namespace joulecast::benchmarks {
namespace {

using namespace planning;

double sink = 0;  // keeps results alive

// CPU time of this thread, which is least affected by other programs.
double cpu_now_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Seconds per call: the minimum of several batches, each long enough for the clock.
double cost_s(const std::function<void()>& work) {
  double best = 1e300;
  std::size_t batch = 1;
  for (int k = 0; k < 7;) {
    const double began = cpu_now_s();
    for (std::size_t i = 0; i < batch; ++i) work();
    const double took = cpu_now_s() - began;
    if (took < 5e-3 && batch < (1u << 24)) {
      batch *= 4;
      continue;
    }
    best = std::min(best, took / static_cast<double>(batch));
    ++k;
  }
  return best;
}

LineTask straight_task(const robot::RobotModel& robot, double distance, double payload) {
  LineTask task;
  task.power = dynamics::straight_power(robot, payload).over_distance();
  task.power.c0 += robot.idle_power_w;
  task.distance = distance;
  return task;
}

// The tasks of the straight solves, all different as those of a scheduler.
std::vector<LineTask> straight_tasks() {
  std::vector<LineTask> tasks;
  for (int k = 0; k < 64; ++k) {
    const robot::RobotModel robot = test::all_robots()[static_cast<std::size_t>(k % 4)];
    tasks.push_back(straight_task(robot, 1 + 0.37 * k, robot.limits.payload_kg * (k % 7) / 7));
  }
  return tasks;
}

void solve_straight(long count) {
  const auto tasks = straight_tasks();
  for (long k = 0; k < count; ++k)
    sink += line_in_free_time(tasks[static_cast<std::size_t>(k % 64)])->duration_s();
}

void solve_limited(long count) {
  const auto tasks = straight_tasks();
  for (long k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k % 64);
    const robot::Limits limits = test::all_robots()[i % 4].limits;
    sink += line_within(tasks[i], 0.7 * limits.speed_m_s, 0.5 * limits.acceleration_m_s2)->duration_s();
  }
}

void single_solves() {
  const long count = 6400;
  std::printf("one solve, end time included\n");
  std::printf("  straight, closed form                        %8.3f us\n",
              1e6 * cost_s([] { solve_straight(count); }) / count);
  std::printf("  straight with speed and acceleration limits  %8.3f us\n",
              1e6 * cost_s([] { solve_limited(count); }) / count);
  const auto planner = Planner::make(test::amr());
  Problem problem;
  problem.limits = limits_of(test::amr());
  for (const auto& [name, segments] :
       {std::pair{"straight 10 m, from path to cost", std::vector<Segment>{Straight{10}}},
        {"turn in place, likewise", {TurnInPlace{1.57}}}}) {
    const auto path = make_path(segments, PathOptions{.start = {}, .payload_kg = 20});
    std::printf("  %-43s  %8.3f us\n", name,
                1e6 * cost_s([&] { sink += planner->cost(*path, problem)->energy_j; }));
  }
  for (const robot::RobotModel& robot : test::all_robots()) {
    for (const double regeneration : {1.0, 0.3}) {
      const double began = cpu_now_s();
      const auto table = CostTable::make(robot, {.value_of_time_w = 0, .regeneration = regeneration});
      const double took = cpu_now_s() - began;
      std::printf(
          "  cost table of %-5s regeneration %.1f: %6zu planner calls, %7.1f ms; a look-up %.3f us; error "
          "%.1e\n",
          robot.robot_id.c_str(), regeneration, table->solves(), 1e3 * took,
          1e6 * cost_s([&] { sink += table->straight(10, 5).energy_j; }), table->interpolation_error());
    }
  }
}

// Ten segments of each kind, with limits, from path to plan.
void ten_segments() {
  std::printf("ten segments within limits          regeneration 1         0.3           0\n");
  std::vector<Segment> turns, arcs;
  std::vector<Point> corners{{2, 0}};
  for (int k = 0; k < 5; ++k) {
    turns.insert(turns.end(), {Straight{2.0 + 0.1 * k}, TurnInPlace{k % 2 ? 1.2 : -0.9}});
    arcs.insert(arcs.end(), {Straight{2.0 + 0.1 * k}, Arc{1.5, k % 2 ? 0.8 : -0.8}});
  }
  for (int k = 1; k < 10; ++k) corners.push_back({2.0 * (k + 1), k % 2 ? 1.0 : 0.0});
  for (const auto& [name, segments] : {std::pair{"straights and turns in place", turns},
                                       {"straights and arcs", arcs},
                                       {"polyline", {Polyline{corners}}}}) {
    std::printf("  %-32s", name);
    const auto path = make_path(segments, PathOptions{.start = {}, .payload_kg = 20});
    Problem problem;
    problem.limits = limits_of(test::amr());
    for (const double regeneration : {1.0, 0.3, 0.0}) {
      const auto planner = Planner::make(test::amr(), regeneration);
      std::printf("  %8.3f ms",
                  1e3 * cost_s([&] { sink += planner->plan(*path, problem)->summary.energy_j; }));
    }
    std::printf("\n");
  }
}

// A path of `count` segments of one kind, a straight between curves that would not join.
std::vector<Segment> segments_of(std::string_view kind, int count) {
  std::vector<Segment> segments;
  Point at{0, 0};
  for (int k = 0; k < count; ++k) {
    const double side = k % 2 ? -1 : 1;
    if (kind == "straights and turns") {
      segments.push_back(k % 2 ? Segment{TurnInPlace{k % 4 == 1 ? 1.2 : -0.9}}
                               : Segment{Straight{2.0 + 0.1 * (k % 5)}});
    } else if (kind == "alternating arcs") {
      segments.push_back(Arc{1.0 + 0.1 * (k % 5), 0.9 * side});
    } else if (kind == "clothoids") {
      segments.push_back(Clothoid{2.0 + 0.1 * (k % 5), -0.5 * side, 0.5 * side});
    } else if (kind == "Beziers") {
      const Point end{at.x_m + 3, at.y_m + side};
      segments.push_back(Bezier{{at.x_m + 1.2, at.y_m}, {end.x_m - 1.2, end.y_m}, end});
      at = end;
    } else {
      segments.push_back(GaussianDetour{6, 0.6 * side, 3, 0.7});
    }
  }
  return segments;
}

// What losses of regeneration, a current limit that binds, and a deadline in the middle of what time can be
// saved take, together, against the plain plan of the same path.
void deadlines(int most) {
  std::printf(
      "a plan [ms]                segments     plain   lossy with current limit   with deadline too   / "
      "plain\n");
  for (const std::string_view kind :
       {"straights and turns", "alternating arcs", "clothoids", "Beziers", "Gaussian detours"}) {
    for (const int count : {1, 3, 10, 30, 100, 300, 1000}) {
      if (count > most) break;
      const auto path = make_path(segments_of(kind, count), PathOptions{.start = {}, .payload_kg = 20});
      Problem problem;
      problem.limits = limits_of(test::amr());
      problem.rows = false;
      const auto plain = Planner::make(test::amr()), lossy = Planner::make(test::amr(), 0.0);
      const auto once_ms = [&](const Planner& planner) {
        const double began = cpu_now_s();
        sink += planner.plan(*path, problem)->summary.energy_j;
        return 1e3 * (cpu_now_s() - began);
      };
      const double plain_ms = once_ms(*plain);
      problem.limits.current_a = 3.5;
      const double free_ms = once_ms(*lossy);
      const auto free = lossy->plan(*path, problem);
      problem.deadline_s = 0.5 * (free->certificate.shortest_time_s + free->summary.duration_s);
      const double hurried_ms = once_ms(*lossy);
      std::printf("  %-24s  %6d  %10.2f  %24.2f  %18.2f  %8.1f\n", std::string(kind).c_str(), count, plain_ms,
                  free_ms, hurried_ms, hurried_ms / plain_ms);
    }
  }
}

void paths() {
  std::printf("paths within limits, regeneration 0.3\n");
  const auto planner = Planner::make(test::amr(), 0.3);
  Problem problem;
  problem.limits = limits_of(test::amr());
  double first = 0;
  for (const int count : {10, 30, 100, 300, 1000}) {
    std::vector<Segment> segments;
    for (int k = 0; k < count; ++k) {
      if (k % 3 == 0) segments.push_back(Straight{2.0 + 0.01 * k});
      if (k % 3 == 1) segments.push_back(TurnInPlace{k % 2 ? 1.2 : -0.9});
      if (k % 3 == 2) segments.push_back(Arc{1.5, k % 2 ? 0.8 : -0.8});
    }
    const auto path = make_path(segments, PathOptions{.start = {}, .payload_kg = 20});
    const double took = cost_s([&] { sink += planner->plan(*path, problem)->summary.energy_j; });
    if (count == 10) first = took;
    std::printf("  %4d segments  %9.3f ms, %6.1f us a segment, %.2f of linear\n", count, 1e3 * took,
                1e6 * took / count, took / count / (first / 10));
  }
  const auto bezier = make_path(std::vector<Segment>{Bezier{{5, 0}, {5, 3}, {9.2, 3}}});
  std::printf("  Bezier of %.2f m, knots 1 cm apart  %.3f ms\n", bezier->distance_m(),
              1e3 * cost_s([&] { sink += planner->plan(*bezier, problem)->summary.energy_j; }));
}

// A motion of three phases along a straight or a turn, as planned by the peer.
PeerTrajectory three_phases(double length, double speed, double acceleration, bool turning,
                            double start = 0) {
  const double ramp_s = speed / acceleration, ramp = 0.5 * speed * ramp_s;
  const double hold_s = (length - 2 * ramp) / speed;
  std::vector<WayPoint> points(4);
  const double times[] = {0, ramp_s, ramp_s + hold_s, 2 * ramp_s + hold_s};
  const double ways[] = {0, ramp, length - ramp, length}, speeds[] = {0, speed, speed, 0};
  const int axis = turning ? 2 : 0;
  for (std::size_t k = 0; k < 4; ++k) {
    points[k].time_s = times[k];
    points[k].position[axis] = turning ? std::remainder(start + ways[k], 2 * std::numbers::pi) : ways[k];
    points[k].velocity[axis] = speeds[k];
  }
  return PeerTrajectory(points);
}

void against_the_peer() {
  const robot::RobotModel robot = test::amr();
  const double payload = 20;
  const PeerRobot peer{robot.total_mass_kg(payload), robot.mass.yaw_inertia_kg_m2 + 0.02 * payload, 0.02};
  const auto planner = Planner::make(robot);
  const auto table = CostTable::make(robot, {});
  Problem problem;
  problem.limits = limits_of(robot);
  std::printf("against dE = sum (m|a||v| + J|alpha||omega| + f m g|v|) 0.5 s\n");
  for (const double length : {10.0, 100.0}) {
    const double v = 1.0, a = 0.5;
    LineTask task = straight_task(robot, length, payload);
    const auto trajectory = three_phases(length, v, a, false);
    std::printf("  %3.0f m straight: peer %8.3f us (%.1f J)\n", length,
                1e6 * cost_s([&] { sink += three_phases(length, v, a, false).energy_j(peer); }),
                trajectory.energy_j(peer));
    std::printf("      ours, the same trapezoid in closed form  %8.3f us (%.1f J)\n",
                1e6 * cost_s([&] { sink += ramp_by_limits(task, v, a)->energy_j(); }),
                ramp_by_limits(task, v, a)->energy_j());
    std::printf("      ours, the optimum from the cost table    %8.3f us (%.1f J)\n",
                1e6 * cost_s([&] { sink += table->straight(length, payload).energy_j; }),
                table->straight(length, payload).energy_j);
  }
  const double omega = 0.6, alpha = 1.5;
  for (const auto& [name, start] : {std::pair{"90 degrees in place", 0.0},
                                    {"90 degrees in place across +-pi", std::numbers::pi / 2 + 0.06}}) {
    const double angle = std::numbers::pi / 2;
    const auto path = make_path(std::vector<Segment>{TurnInPlace{angle}},
                                PathOptions{.start = {0, 0, start}, .payload_kg = payload});
    const double ramp_s = omega / alpha;
    const double whole_s = angle / omega + ramp_s;
    const auto driven =
        ramp_baseline(planner->loads(), *path, std::vector<double>{whole_s}, 0, 0, ramp_s / whole_s);
    std::printf(
        "  %s: peer %.1f J; ours %.1f J for the same motion, %.1f J for the best one, %.3f us from the "
        "table\n",
        name, three_phases(angle, omega, alpha, true, start).energy_j(peer), driven->energy_j,
        planner->cost(*path, problem)->energy_j,
        1e6 * cost_s([&] { sink += table->turn(angle, payload).energy_j; }));
  }
}

void quantiles(const char* name, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double q) {
    return 100 * values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
  };
  std::printf("  %-52s %4zu  %6.1f %6.1f %6.1f %6.1f %6.1f %6.1f %6.1f\n", name, values.size(), at(0),
              at(0.05), at(0.25), at(0.5), at(0.75), at(0.95), at(1));
}

// The best ramp within the limits: golden section of the duration, from the shortest feasible one to ten
// times the optimum.
std::optional<double> best_ramp_cost(const DriveLoads& loads, const Path& run, const Problem& problem,
                                     double optimum_s, double fraction) {
  const auto cost = [&](double duration) -> double {
    const auto b = ramp_baseline(loads, run, std::vector<double>{duration}, problem.start_speed_m_s,
                                 problem.end_speed_m_s, fraction);
    if (!b) return 1e300;
    if (!b->beyond(problem.limits).empty()) return 1e300;
    return b->energy_j + problem.value_of_time_w * b->duration_s;
  };
  double best = 1e300, at = 0;
  for (int k = -40; k <= 60; ++k) {
    const double duration = optimum_s * std::exp(0.04 * k), c = cost(duration);
    if (c < best) best = c, at = duration;
  }
  if (best > 1e299) return {};
  double low = at * std::exp(-0.04), high = at * std::exp(0.04);
  for (int k = 0; k < 30; ++k) {
    const double a = high - 0.618034 * (high - low), b = low + 0.618034 * (high - low);
    const double ca = cost(a), cb = cost(b);
    best = std::min({best, ca, cb});
    (ca <= cb && ca < 1e299 ? high : low) = ca <= cb && ca < 1e299 ? b : a;
  }
  return best;
}

void savings() {
  std::vector<double> equal[2], driveable[2], free_time[2];
  for (std::uint64_t seed = 0; seed < 220; ++seed) {
    const test::RandomProblem p = test::random_problem(seed);
    const auto path = make_path(p.segments, p.options);
    Path run;
    run.runs = {path->runs.back()};
    const auto answer = plan(p.robot, run, p.problem);
    const auto loads = DriveLoads::make(p.robot, p.problem.regeneration);
    if (!answer || !loads) continue;
    const double duration = answer->summary.duration_s, energy = answer->summary.energy_j;
    const double cost = energy + p.problem.value_of_time_w * duration;
    for (int shape : {0, 1}) {
      const double fraction = shape == 0 ? 1.0 / 3 : 0.5;
      const auto same = ramp_baseline(*loads, run, std::vector<double>{duration}, p.problem.start_speed_m_s,
                                      p.problem.end_speed_m_s, fraction);
      if (same) {
        equal[shape].push_back(1 - energy / same->energy_j);
        if (same->beyond(p.problem.limits).empty()) driveable[shape].push_back(equal[shape].back());
      }
      if (const auto best = best_ramp_cost(*loads, run, p.problem, duration, fraction))
        free_time[shape].push_back(1 - cost / *best);
    }
  }
  std::printf(
      "saved by the optimum over 220 random problems [%%]       n     min     5%%    25%%    50%%    75%%    "
      "95%%    max\n");
  quantiles("trapezoid (thirds) in the optimum's time, energy", equal[0]);
  quantiles("  of them those that keep all limits", driveable[0]);
  quantiles("triangle in the optimum's time, energy", equal[1]);
  quantiles("  of them those that keep all limits", driveable[1]);
  quantiles("trapezoid in its own best time, energy + value of time", free_time[0]);
  quantiles("triangle in its own best time, energy + value of time", free_time[1]);
}

}  // namespace
}  // namespace joulecast::benchmarks

int main(int argc, char** argv) {
  using namespace joulecast::benchmarks;
  if (argc == 3 && std::strcmp(argv[1], "--straight") == 0) {
    solve_straight(std::atol(argv[2]));
  } else if (argc == 3 && std::strcmp(argv[1], "--limited") == 0) {
    solve_limited(std::atol(argv[2]));
  } else if (argc == 3 && std::strcmp(argv[1], "--deadlines") == 0) {
    deadlines(std::atoi(argv[2]));
  } else if (argc == 1) {
    single_solves();
    ten_segments();
    paths();
    deadlines(100);
    against_the_peer();
    savings();
  } else {
    std::fprintf(stderr, "planner_cost [--straight N | --limited N | --deadlines N]\n");
    return 2;
  }
  return std::isfinite(sink) ? 0 : 1;
}
