// Turning scrub builds up with the yaw rate: plans, their energies and refusals follow its law.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "planning/baseline.h"
#include "planning/planner.h"
#include "tests/planning/robots.h"

namespace joulecast::planning {
namespace {

robot::RobotModel scrubbing(robot::RobotModel robot, double coefficient, double rate_rad_s) {
  robot.effects.push_back({"turning_scrub", {{"coefficient", coefficient}, {"rate_rad_s", rate_rad_s}}});
  return robot;
}

// Energy of a turn in place of this speed over time, by the drive model in steps too small to matter.
double driven_j(const DriveLoads& loads, const Run& run, const std::vector<double>& time_s,
                const std::vector<double>& speed) {
  double sum = 0;
  constexpr int steps = 200;
  for (std::size_t k = 0; k + 1 < time_s.size(); ++k) {
    const double span = time_s[k + 1] - time_s[k], rate = (speed[k + 1] - speed[k]) / span;
    for (int i = 0; i < steps; ++i) {
      const double v = speed[k] + rate * span * (i + 0.5) / steps;
      sum += span / steps * loads.model().flow(loads.instant(run, run.at(0), v, rate)).battery_power_w;
    }
  }
  return sum;
}

TEST(Scrub, EnergiesMatchTheMotion) {
  std::mt19937_64 random(5);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  for (int k = 0; k < 24; ++k) {
    const robot::RobotModel robot = scrubbing(test::all_robots()[static_cast<std::size_t>(k % 4)],
                                              between(0.1, 1), k % 3 ? 0.02 : between(0.005, 0.3));
    const auto path = make_path(std::vector<Segment>{TurnInPlace{between(0.2, 3)}}, PathOptions{});
    Problem problem;
    problem.limits = limits_of(robot);
    const auto planner = Planner::make(robot, k % 2 ? 1.0 : 0.4);
    const auto plan = planner->plan(*path, problem);
    ASSERT_TRUE(plan) << describe(plan.error());
    const planning::Run& run = path->runs[0];
    const double energy = driven_j(planner->loads(), run, plan->profile.time_s, plan->profile.yaw_rate_rad_s);
    EXPECT_NEAR(plan->summary.energy_j, energy, 3e-4 * energy) << k;
    const double whole_s = plan->summary.duration_s, top = run.length() / whole_s / 0.7;
    const auto ramp = ramp_baseline(planner->loads(), *path, std::vector<double>{whole_s}, 0, 0, 0.3);
    ASSERT_TRUE(ramp);
    const double ramp_j =
        driven_j(planner->loads(), run, {0, 0.3 * whole_s, 0.7 * whole_s, whole_s}, {0, top, top, 0});
    EXPECT_NEAR(ramp->energy_j, ramp_j, 3e-4 * ramp_j) << k;
    if (ramp->beyond(problem.limits).empty()) {
      EXPECT_LT(plan->summary.energy_j, ramp_j * (1 + 1e-3)) << k;
    }
  }
}

// With a law that rises slowly, slow and fast turns are separate optima: the plan costs no more than any
// trapezoid, and its certificate does not claim global optimality.
TEST(Scrub, PlansAvoidLocalOptima) {
  robot::RobotModel robot = scrubbing(test::amr(), 1.0, 0.7);
  robot.effects.push_back({"no_regeneration", {{"fraction", 1.0}}});
  const auto planner = Planner::make(robot);
  Problem problem;
  problem.limits = limits_of(robot);
  for (const Segment& segment :
       {Segment{Arc{0.6, 2}}, Segment{TurnInPlace{2}}, Segment{Clothoid{2, -0.5, 2}}}) {
    const auto path = make_path(std::vector<Segment>{segment}, PathOptions{.start = {}, .payload_kg = 20});
    const auto plan = planner->plan(*path, problem);
    ASSERT_TRUE(plan) << describe(plan.error());
    EXPECT_FALSE(plan->certificate.convex);
    double best = 1e300;
    for (double duration = plan->certificate.shortest_time_s; duration < 60; duration *= 1.03) {
      for (const double fraction : {0.05, 0.1, 0.2, 0.3}) {
        const auto ramp =
            ramp_baseline(planner->loads(), *path, std::vector<double>{duration}, 0, 0, fraction);
        if (ramp && ramp->beyond(problem.limits).empty()) best = std::min(best, ramp->energy_j);
      }
    }
    EXPECT_LT(plan->summary.energy_j, best * (1 + 1e-3));
  }
}

TEST(Scrub, SlowTurnsNeedLittleCurrent) {
  robot::RobotModel robot = scrubbing(test::amr(), 1.0, 0.7);
  const auto path = make_path(std::vector<Segment>{TurnInPlace{1}}, PathOptions{});
  Problem problem;
  problem.limits = limits_of(robot);
  problem.limits.current_a = 3;  // built up, scrub alone takes more
  const auto plan = planning::plan(robot, *path, problem);
  ASSERT_TRUE(plan) << describe(plan.error());
  EXPECT_LT(plan->summary.peak_yaw_rate_rad_s, 1);
}

}  // namespace
}  // namespace joulecast::planning
