// Plans whose current, voltage or acceleration limits bind, or whose braking is not returned, against direct
// transcription.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "planning/peaks.h"
#include "planning/planner.h"
#include "tests/planning/robots.h"
#include "tests/planning/transcription.h"

namespace joulecast::planning {
namespace {

struct LimitedProblem {
  robot::RobotModel robot;
  Path path;
  Problem problem;
  std::string label;
};

LimitedProblem limited_problem(std::uint64_t seed) {
  std::mt19937_64 random(seed * 104729 + 7);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  LimitedProblem p;
  p.robot = test::all_robots()[seed % 4];
  const double payload = between(0, p.robot.limits.payload_kg);
  const int kind = static_cast<int>(random() % 4);
  std::vector<Segment> segments{Straight{std::exp(between(std::log(0.5), std::log(12)))}};
  if (kind == 2) segments = {TurnInPlace{between(0.5, 3)}};
  if (kind == 3) segments = {Arc{between(0.6, 3), between(0.6, 2)}};
  p.path = *make_path(segments, PathOptions{.start = {}, .payload_kg = payload});
  p.problem.limits = limits_of(p.robot);
  const double fractions[] = {1, 0.4, 0};
  p.problem.regeneration = fractions[random() % 3];
  const auto& m = p.robot.motor;
  const double kn = m.torque_constant_nm_a * m.gear_ratio;
  const double friction = std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / kn;
  const double push = p.robot.total_mass_kg(payload) * p.robot.kinematics.wheel_radius_m / 2 / kn;
  const int limit = static_cast<int>(random() % 3);
  if (limit == 0) p.problem.limits.current_a = 1.05 * friction + push * between(0.05, 0.3) + m.viscous_friction_nm_s_rad * 4 / kn;
  if (limit == 1) p.problem.limits.voltage_v *= between(0.3, 0.7);
  p.problem.value_of_time_w = random() % 2 ? between(0, 100) : 0;
  p.label = p.robot.robot_id + (kind == 2 ? " turn" : kind == 3 ? " arc" : " straight") + " limit " + std::to_string(limit);
  return p;
}

class Limited : public testing::TestWithParam<int> {};

TEST_P(Limited, PlansAreOptimalAndTheirCertificatesTrue) {
  const LimitedProblem p = limited_problem(static_cast<std::uint64_t>(GetParam()));
  SCOPED_TRACE(p.label);
  const auto planner = Planner::make(p.robot, p.problem.regeneration);
  ASSERT_TRUE(planner);
  const planning::Run& run = p.path.runs[0];
  const auto free = planner->plan(p.path, p.problem);
  ASSERT_TRUE(free) << describe(free.error());
  const double shortest = free->certificate.shortest_time_s;
  EXPECT_NEAR(shortest, test::least_time_s(p.robot, planner->loads().model(), run, p.problem.limits),
              3e-4 * shortest);
  // Every deadline from the shortest time on is met.
  for (const double share : {0.0, 1e-5, 1e-3, 0.03, 0.5}) {
    Problem hurried = p.problem;
    hurried.deadline_s = shortest + share * (free->summary.duration_s - shortest) + 1e-9;
    const auto plan = planner->plan(p.path, hurried);
    ASSERT_TRUE(plan) << share << ": " << describe(plan.error());
    EXPECT_LE(plan->summary.duration_s, *hurried.deadline_s * (1 + 1e-9));
    EXPECT_GE(plan->summary.energy_j, free->summary.energy_j * (1 - 1e-5) -
                                          p.problem.value_of_time_w * (free->summary.duration_s - *hurried.deadline_s));
  }
  for (const double share : {1.0, 0.1}) {
    Problem hurried = p.problem;
    if (share < 1) hurried.deadline_s = shortest + share * (free->summary.duration_s - shortest);
    const auto plan = share < 1 ? planner->plan(p.path, hurried) : free;
    ASSERT_TRUE(plan) << describe(plan.error());
    const double price = share < 1 ? plan->certificate.time_multiplier_w : p.problem.value_of_time_w;
    const double cost = plan->summary.energy_j + price * plan->summary.duration_s;
    const auto best = test::transcribed(p.robot, planner->loads().model(), run, p.problem.limits, 0, 0, price, 400);
    const Certificate& c = plan->certificate;
    EXPECT_LT(best.excess, 1e-3);
    EXPECT_LT(cost, best.cost_j + c.gap_j + c.discretisation_j + 1e-4 * best.cost_j) << share;
    EXPECT_GT(cost, best.cost_j * (1 - 5e-4)) << share;
    EXPECT_LT(c.gap_j + c.discretisation_j, 5e-4 * cost);
  }
}

INSTANTIATE_TEST_SUITE_P(Problems, Limited, testing::Range(0, 40));

}  // namespace
}  // namespace joulecast::planning
