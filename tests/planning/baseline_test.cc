#include "planning/baseline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/planning/robots.h"
#include "tests/study/ramp/ramp.h"
#include "tests/support/straight_power.h"

namespace joulecast::planning {
namespace {

Path straight(double length_m, double payload_kg) {
  PathOptions options;
  options.payload_kg = payload_kg;
  return *make_path(std::vector<Segment>{Straight{length_m}}, options);
}

// On a straight line power is the quadratic (4-1), with ramps that integrate in closed form. The drive's
// smooth sign removes friction below some multiples of 0.005 rad/s of wheel speed, a thousandth of a ramp to
// 0.5 m/s.
TEST(Baseline, AgreesWithTheClosedForm) {
  for (const robot::RobotModel& robot : {test::nomad(), test::p3dx()}) {
    const auto loads = DriveLoads::make(robot, {});
    for (const double payload : {0.0, 5.0}) {
      for (const double fraction : {1.0 / 3, 0.5}) {
        LineTask task;
        task.power = dynamics::straight_power(robot, payload).over_distance();
        task.power.c0 += robot.idle_power_w;
        task.distance = 8;
        task.start_speed = 0.1;
        task.end_speed = 0.3;
        const auto ramp = ramp_in_time(task, 15, fraction);
        const std::vector<double> durations{15};
        const auto baseline = ramp_baseline(*loads, straight(8, payload), durations, 0.1, 0.3, fraction);
        ASSERT_TRUE(ramp && baseline);
        EXPECT_NEAR(baseline->energy_j, ramp->energy_j(), 1e-4 * ramp->energy_j()) << robot.robot_id;
        EXPECT_NEAR(baseline->peak_speed_m_s, ramp->peak_speed(), 1e-9);
        EXPECT_EQ(baseline->duration_s, 15);
      }
    }
  }
}

// Where braking power is lost, a motor that becomes a generator makes a kink, found to a small part of the
// energy.
TEST(Baseline, FindsWhereBrakingBegins) {
  robot::RobotModel robot = test::nomad();
  robot.effects = {{"no_regeneration", {{"fraction", 1}}}};
  const auto loads = DriveLoads::make(robot, {});
  const double payload = 5, length = 8, duration = 8;
  const std::vector<double> durations{duration};
  const auto baseline = ramp_baseline(*loads, straight(length, payload), durations, 0, 0, 0.5);
  ASSERT_TRUE(baseline);
  const auto power = dynamics::straight_power(robot, payload);
  const double top = 2 * length / duration / power.wheel_radius_m, a = top / (duration / 2);
  double expected = robot.idle_power_w * duration;
  constexpr int steps = 100'000;
  for (int k = 0; k < steps; ++k) {
    const double w = top * (k + 0.5) / steps;
    for (const dynamics::QuadraticPower& side : power.side)
      expected += (side.power_w(w, a) + std::max(0.0, side.power_w(w, -a))) * duration / 2 / steps;
  }
  EXPECT_NEAR(baseline->energy_j, expected, 1e-3 * expected);
}

}  // namespace
}  // namespace joulecast::planning
