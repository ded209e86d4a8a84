#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "planning/line.h"
#include "planning/planner.h"
#include "tests/planning/robots.h"
#include "tests/support/straight_power.h"

namespace joulecast::planning {
namespace {

LineTask random_limited_task(std::mt19937_64& random, const robot::RobotModel& robot) {
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  LineTask task;
  task.power = dynamics::straight_power(robot, between(0, robot.limits.payload_kg)).over_distance();
  task.power.c0 += robot.idle_power_w;
  task.distance = std::exp(between(std::log(0.05), std::log(200)));
  task.value_of_time_w = random() % 2 ? between(0, 100) : 0;
  return task;
}

// The profile's own columns: speed is the derivative of position, acceleration of speed, energy the integral
// of power; limits hold.
TEST(LimitedLine, IsDriveableWithinItsLimits) {
  std::mt19937_64 random(5);
  int held_speed = 0, held_acceleration = 0;
  for (int k = 0; k < 400; ++k) {
    const robot::RobotModel robot = test::all_robots()[static_cast<std::size_t>(k % 4)];
    LineTask task = random_limited_task(random, robot);
    const double top = std::uniform_real_distribution(0.2, 2.0)(random) * robot.limits.speed_m_s;
    const double most = std::uniform_real_distribution(0.3, 2.0)(random) * robot.limits.acceleration_m_s2;
    if (k % 3 == 0) task.start_speed = 0.2 * top, task.end_speed = k % 2 ? 0.1 * top : 0;
    const auto line = line_within(task, top, most);
    if (!line) {
      // Refused only where the end speeds are too high for the distance.
      EXPECT_GT(task.start_speed + task.end_speed, 0);
      EXPECT_LT(task.distance, 4 * top * top / most);
      continue;
    }
    held_speed += line->holds_speed(), held_acceleration += line->holds_acceleration();
    EXPECT_NEAR(line->distance(), task.distance, 1e-9 * task.distance);
    EXPECT_LE(line->peak_speed(), top * (1 + 1e-9));
    EXPECT_LE(line->peak_acceleration(), most * (1 + 1e-9));
    EXPECT_LT(line->residual_w(), 1e-6 * (task.power.c0 + task.value_of_time_w));
    const auto times = line->times(2000);
    double energy = 0;
    for (std::size_t i = 0; i + 1 < times.size(); ++i) {
      const double a = times[i], b = times[i + 1], h = b - a;
      // Ends are inside the piece, so that Simpson's rule and differences see one analytic arc.
      const double t0 = a + 1e-9 * h, t1 = b - 1e-9 * h, mid = 0.5 * (a + b);
      const auto power = [&](double t) { return task.power.power_w(line->speed(t), line->acceleration(t)); };
      energy += h / 6 * (power(t0) + 4 * power(mid) + power(t1));
      EXPECT_NEAR(line->position(t1) - line->position(t0),
                  h / 6 * (line->speed(t0) + 4 * line->speed(mid) + line->speed(t1)),
                  1e-7 * task.distance + 1e-9);
      EXPECT_NEAR(line->speed(t1) - line->speed(t0),
                  h / 6 * (line->acceleration(t0) + 4 * line->acceleration(mid) + line->acceleration(t1)),
                  1e-6 * top);
    }
    EXPECT_NEAR(line->energy_j(), energy, 1e-6 * std::fabs(energy));
    EXPECT_NEAR(line->speed(0), task.start_speed, 1e-9);
    EXPECT_NEAR(line->speed(line->duration_s()), task.end_speed, 1e-7 * top);
    EXPECT_GE(line->duration_s(), shortest_time_within(task, top, most) * (1 - 1e-9));
  }
  EXPECT_GT(held_speed, 50);
  EXPECT_GT(held_acceleration, 50);
}

// No other profile within the limits costs less: the numerical solver, kept from the closed form by a loss of
// regeneration of 1e-9, ends at the same cost, from above.
TEST(LimitedLine, AgreesWithTheNumericalSolver) {
  std::mt19937_64 random(6);
  for (int k = 0; k < 40; ++k) {
    const robot::RobotModel robot = test::all_robots()[static_cast<std::size_t>(k % 4)];
    const double distance = std::exp(std::uniform_real_distribution(std::log(0.1), std::log(40.0))(random));
    Problem problem;
    problem.limits = limits_of(robot);
    problem.value_of_time_w = k % 2 ? 40 : 0;
    problem.intervals_per_run = 256;
    const auto path =
        make_path(std::vector<Segment>{k % 5 == 0   ? Segment(TurnInPlace{std::fmod(distance, 3.0) + 0.1})
                                       : k % 5 == 1 ? Segment(Arc{1.5, 1.2})
                                                    : Segment(Straight{distance})});
    ASSERT_TRUE(path);
    const auto closed = plan(robot, *path, problem);
    ASSERT_TRUE(closed) << describe(closed.error());
    EXPECT_EQ(closed->certificate.method, Method::closed_form) << robot.robot_id << " " << distance;
    problem.regeneration = 1 - 1e-9;
    const auto numeric = plan(robot, *path, problem);
    ASSERT_TRUE(numeric);
    ASSERT_EQ(numeric->certificate.method, Method::quadrature);
    const double w = problem.value_of_time_w;
    const double ours = closed->summary.energy_j + w * closed->summary.duration_s,
                 theirs = numeric->summary.energy_j + w * numeric->summary.duration_s;
    // Both are integrated along their own rows, through friction that fades below 0.005 rad/s. The solver's
    // many rows see that, a ramp's few do not: some milliseconds of dry friction at each end.
    EXPECT_LT(ours, theirs * (1 + 1e-4));
    EXPECT_GT(ours, theirs * (1 - 3e-4)) << robot.robot_id << " " << distance;
  }
}

TEST(LimitedLine, LongWaysApproachTheCheapestSpeed) {
  const robot::RobotModel robot = test::nomad();
  LineTask task;
  task.power = dynamics::straight_power(robot, 0).over_distance();
  task.power.c0 += robot.idle_power_w;
  task.distance = 1e4;
  const auto line = line_within(task, 1e3, 0.05);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->peak_speed(), std::sqrt(task.power.c0 / task.power.c2), 1e-6 * line->peak_speed());
  EXPECT_NEAR(line->distance(), task.distance, 1e-6);
}

}  // namespace
}  // namespace joulecast::planning
