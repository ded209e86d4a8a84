// Plans of vehicles that cannot creep, compared with iterative dynamic programming.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "planning/planner.h"
#include "tests/planning/reference.h"
#include "tests/planning/robots.h"

namespace joulecast::planning {
namespace {

Problem without_motor_limits(const robot::RobotModel& robot, double least_speed_m_s) {
  Problem problem;
  problem.limits = limits_of(robot);
  problem.limits.current_a = problem.limits.voltage_v = unlimited;
  problem.limits.least_speed_m_s = least_speed_m_s;
  return problem;
}

// The squared speed rises from a stop by at least the limit of acceleration times the way.
double least_at(const Limits& limits, double since_start_m, double to_end_m) {
  return std::min({limits.least_speed_m_s, std::sqrt(limits.acceleration_m_s2 * std::max(since_start_m, 0.0)),
                   std::sqrt(limits.acceleration_m_s2 * std::max(to_end_m, 0.0))});
}

TEST(LeastSpeed, CostsAreTheReferences) {
  for (const robot::RobotModel& robot : test::all_robots()) {
    for (const std::vector<Segment>& segments : {std::vector<Segment>{Straight{6}},
                                                 {Straight{0.3}},
                                                 {Arc{2.5, 1.5}},
                                                 {Straight{2}, Arc{3, 1}, Straight{2}}}) {
      for (const double share : {0.15, 0.6, 0.85}) {
        const Problem problem = without_motor_limits(robot, share * robot.limits.speed_m_s);
        const auto path = make_path(segments, {});
        ASSERT_TRUE(path);
        SCOPED_TRACE(robot.robot_id + " " + std::to_string(path->runs[0].length()) + " " +
                     std::to_string(share));
        const auto answer = plan(robot, *path, problem);
        if (!answer) {  // the yaw rate limit of a bend is below the least speed
          EXPECT_EQ(answer.error().field, "limits/least_speed_m_s");
          EXPECT_GT(
              problem.limits.least_speed_m_s * path->runs[0].at(path->runs[0].length() / 2).curvature_1_m,
              robot.limits.yaw_rate_rad_s);
          continue;
        }
        const Profile& rows = answer->profile;
        for (std::size_t k = 0; k < rows.size(); ++k)
          EXPECT_GE(rows.speed_m_s[k], (1 - 2e-3) * least_at(problem.limits, rows.distance_m[k],
                                                             rows.distance_m.back() - rows.distance_m[k]) -
                                           1e-3)
              << rows.distance_m[k];
        const auto loads = DriveLoads::make(robot, problem.regeneration);
        test::ReferenceAnswer best;
        best.cost_j = std::numeric_limits<double>::infinity();
        for (const int stations : {48, 80, 128}) {
          const auto found =
              test::reference(robot, loads->model(), path->runs[0], problem.limits, 0, 0, 0, stations);
          if (found.excess < 1e-3 && found.cost_j < best.cost_j) best = found;
          if (std::fabs(answer->summary.energy_j - best.cost_j) < 8e-4 * best.cost_j) break;
        }
        EXPECT_NEAR(answer->summary.energy_j, best.cost_j, 1e-3 * best.cost_j);
        EXPECT_LT(answer->certificate.gap_j, 1e-3 * answer->summary.energy_j);
      }
    }
  }
}

// A robot for which driving slowly is cheap.
robot::RobotModel slow_robot() {
  robot::RobotModel robot = test::amr();
  robot.idle_power_w = 1;
  return robot;
}

TEST(LeastSpeed, FreePlansThatKeepItRemain) {
  const robot::RobotModel robot = slow_robot();
  const auto path = make_path(std::vector<Segment>{Straight{8}, TurnInPlace{1.5}, Straight{5}}, {});
  const auto free = plan(robot, *path, without_motor_limits(robot, 0));
  const auto slow = plan(robot, *path, without_motor_limits(robot, 0.05));
  ASSERT_TRUE(free && slow);
  EXPECT_NEAR(slow->summary.energy_j, free->summary.energy_j, 2e-4 * free->summary.energy_j);
  EXPECT_NEAR(slow->summary.duration_s, free->summary.duration_s, 2e-3 * free->summary.duration_s);
  // It costs energy where the free plan is slower, and turns in place and halts remain.
  const auto fast = plan(robot, *path, without_motor_limits(robot, 1.3));
  ASSERT_TRUE(fast);
  EXPECT_GT(fast->summary.energy_j, 1.01 * free->summary.energy_j);
  EXPECT_NEAR(fast->run_duration_s[1], free->run_duration_s[1], 1e-6);
}

TEST(LeastSpeed, InfeasibleCombinationsAreNamed) {
  const robot::RobotModel robot = test::amr();
  const auto error_of = [&](const std::vector<Segment>& segments, const Problem& problem) {
    const auto path = make_path(segments, {});
    EXPECT_TRUE(path);
    const auto answer = plan(robot, *path, problem);
    return answer ? Error{} : answer.error();
  };
  const Error above = error_of({Straight{3}}, without_motor_limits(robot, 1.01 * robot.limits.speed_m_s));
  EXPECT_EQ(above.field, "limits/least_speed_m_s");
  EXPECT_EQ(above.fault, Fault::infeasible);
  const Error bend = error_of({Straight{3}, Arc{0.3, 1.5}, Straight{3}}, without_motor_limits(robot, 1));
  EXPECT_EQ(bend.field, "limits/least_speed_m_s");
  EXPECT_NE(bend.message.find("yaw_rate allows at most 0.54"), std::string::npos) << bend.message;
  Problem weak = without_motor_limits(robot, 1);
  weak.limits.voltage_v = 12;
  const Error slow = error_of({Straight{6}}, weak);
  EXPECT_EQ(slow.field, "limits/least_speed_m_s");
  EXPECT_NE(slow.message.find("the other limits allow"), std::string::npos) << slow.message;
}

// With 40 s for 6 m the mean speed is 0.15 m/s.
TEST(LeastSpeed, NeededSpeedIsNoLess) {
  const robot::RobotModel robot = test::amr();
  const auto path = make_path(std::vector<Segment>{Straight{6}}, {});
  Problem problem = without_motor_limits(robot, 0.2);
  problem.deadline_s = 40;
  const auto needed = Planner::make(robot, {})->needed_speed(*path, problem, {});
  ASSERT_TRUE(needed) << describe(needed.error());
  EXPECT_EQ(*needed, 0.2);
}

TEST(LeastSpeed, DeadlinesAndBudgetsKeepIt) {
  const robot::RobotModel robot = slow_robot();
  const auto path = make_path(std::vector<Segment>{Straight{10}}, {});
  Problem problem = without_motor_limits(robot, 0.9);
  const auto free = plan(robot, *path, problem);
  ASSERT_TRUE(free);
  problem.deadline_s = 0.9 * free->summary.duration_s;
  const auto met = plan(robot, *path, problem);
  ASSERT_TRUE(met) << describe(met.error());
  EXPECT_LE(met->summary.duration_s, *problem.deadline_s);
  problem.deadline_s.reset();
  problem.energy_budget_j = 1.02 * free->summary.energy_j;
  const auto spent = plan(robot, *path, problem);
  ASSERT_TRUE(spent) << describe(spent.error());
  EXPECT_LE(spent->summary.energy_j, *problem.energy_budget_j);
  EXPECT_LT(spent->summary.duration_s, free->summary.duration_s);
}

}  // namespace
}  // namespace joulecast::planning
