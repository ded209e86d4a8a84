#include "energy/motion_estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/sample_robots.h"

namespace joulecast::energy {
namespace {

// The thesis's (4-1) with exact coefficients, integrated by Simpson's rule: exact over spans of constant
// acceleration.
TEST(MotionEstimate, MatchesClosedFormOnTrapezoid) {
  const robot::RobotModel robot = testing::nomad();
  const dynamics::DriveModel model(robot, {});
  const std::vector<MotionPoint> points = {{0, 0, 0}, {4, 0.8, 0}, {9, 0.8, 0}, {13, 0, 0}};
  const double payload = 5.7, kn = 0.069 * 24.9, rho = 2.74 / (kn * kn);
  const double inertia = 0.028 + (21.2 + 2 * 1.39 + payload) * 0.01 / 2;
  double expected = 0;
  for (std::size_t k = 1; k < points.size(); ++k) {
    const double h = points[k].time_s - points[k - 1].time_s;
    const double a = (points[k].speed_m_s - points[k - 1].speed_m_s) / 0.1 / h;
    const auto power = [&](double v) {
      double sum = 14;
      for (double friction : robot.motor.friction_torque_nm) {
        const double torque = inertia * a + 0.0017 * v / 0.1 + friction;
        sum += rho * torque * torque + v / 0.1 * torque;
      }
      return sum;
    };
    const double v0 = points[k - 1].speed_m_s, v1 = points[k].speed_m_s;
    expected += h / 6 * (power(v0) + 4 * power((v0 + v1) / 2) + power(v1));
  }
  const auto accounts = estimate_motion(model, points, payload);
  ASSERT_TRUE(accounts) << describe(accounts.error());
  // Friction's smooth sign saves a little where the wheels barely turn: width 0.005 rad/s of 8 rad/s.
  EXPECT_NEAR(accounts->battery_j, expected, 1e-3 * expected);
  EXPECT_NEAR(accounts->ledger.total(), accounts->battery_j, 1e-9 * expected);
  EXPECT_NEAR(accounts->distance_m, 0.8 * 9, 1e-6);
  EXPECT_NEAR(accounts->ledger[signals::Term::kinetic], 0, 1e-4);
}

TEST(MotionEstimate, UsesFloorWithStartPose) {
  robot::RobotModel robot = testing::nomad();
  robot.effects.push_back({"floor_resistance_zone", {{"coefficient", 0.05}, {"x_m", 5}, {"radius_m", 1}}});
  const auto model = *dynamics::drive_model(robot);
  const std::vector<MotionPoint> points = {{0, 0, 0}, {2, 1, 0}, {10, 1, 0}, {12, 0, 0}};
  const auto blind = estimate_motion(model, points, 0);
  const auto placed = estimate_motion(model, points, 0, StartPose{});
  ASSERT_TRUE(blind && placed);
  EXPECT_EQ(blind->ledger[signals::Term::friction_zone], 0);
  // Coefficient times weight times the two metres of the zone's diameter.
  const double weight = robot.total_mass_kg(0) * robot::standard_gravity_m_s2;
  EXPECT_NEAR(placed->ledger[signals::Term::friction_zone], 0.05 * weight * 2, 1e-3 * weight);
}

// There and back over a hill, forward and in reverse: the weight's energy is that of the height, to rounding.
TEST(MotionEstimate, CountsEachHeightOnce) {
  robot::RobotModel robot = testing::nomad();
  robot.effects.push_back({"grade", {{"share", 1}}});
  const auto model = *dynamics::drive_model(robot);
  const double weight = robot.total_mass_kg(3) * robot::standard_gravity_m_s2;
  const double none = dynamics::unknown;
  for (const double way : {1.0, -1.0}) {
    const std::vector<MotionPoint> points = {{0, 0, 0, none, 7},
                                             {2, way * 1, 0, none, 7.05},
                                             {10, way * 1, 0.1, none, 7.5},
                                             {12, 0, 0, none, 7.4}};
    const auto accounts = estimate_motion(model, points, 3);
    ASSERT_TRUE(accounts) << describe(accounts.error());
    EXPECT_NEAR(accounts->ledger[signals::Term::potential], weight * 0.4, 1e-5 * weight);
    EXPECT_NEAR(accounts->ledger.total(), accounts->battery_j, 1e-9 * accounts->battery_j);
  }
  // The height needs the effect, and the effect needs a height.
  const std::vector<MotionPoint> up = {{0, 0.5, 0, none, 0}, {10, 0.5, 0, none, 0.3}};
  const std::vector<MotionPoint> blind = {{0, 0.5, 0}, {10, 0.5, 0}};
  const dynamics::DriveModel nominal(testing::nomad(), {});
  EXPECT_EQ(estimate_motion(nominal, up, 3)->battery_j, estimate_motion(nominal, blind, 3)->battery_j);
  EXPECT_EQ(estimate_motion(model, blind, 3)->ledger[signals::Term::potential], 0);
}

TEST(MotionEstimate, InterpolatesTheClimb) {
  robot::RobotModel robot = testing::nomad();
  robot.effects.push_back({"grade", {{"share", 0.5}}});
  const auto model = *dynamics::drive_model(robot);
  const double weight = robot.total_mass_kg(0) * robot::standard_gravity_m_s2;
  const std::vector<MotionPoint> points = {
      {0, 0.5, 0, 0}, {10, 0.5, 0, 0.04}, {20, 0.5, 0, dynamics::unknown}};
  const auto accounts = estimate_motion(model, points, 0);
  ASSERT_TRUE(accounts);
  // Half the weight over 5 m at 0.02 on the average; the last span's climb is unknown.
  EXPECT_NEAR(accounts->ledger[signals::Term::potential], 0.5 * weight * 5 * 0.02, 1e-3 * weight * 0.05);
}

TEST(MotionEstimate, RejectsImpossibleHeights) {
  const dynamics::DriveModel model(testing::nomad(), {});
  const double none = dynamics::unknown;
  for (const double speed : {0.5, 0.0}) {
    const auto refused = estimate_motion(
        model,
        std::vector<MotionPoint>{{0, speed, 0, none, 0}, {1, speed, 0, none, 0}, {2, speed, 0, none, 0.4}},
        0);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().field, "height_m/2");
  }
}

TEST(MotionEstimate, RejectsNonIncreasingTimes) {
  const dynamics::DriveModel model(testing::nomad(), {});
  for (const double step : {0.0, -1.0, 1e-320}) {
    const auto refused =
        estimate_motion(model, std::vector<MotionPoint>{{-1, 0, 0}, {0, 1, 0}, {step, 0, 0}}, 0);
    ASSERT_FALSE(refused) << step;
    EXPECT_EQ(refused.error().field, "time_s/2");
  }
}

// The columns of a profile repeat the point at the end of a stop; a motion of one instant is none.
TEST(MotionEstimate, RepeatedPointsAddNothing) {
  const dynamics::DriveModel model(testing::nomad(), {});
  const MotionPoint a{0, 0.5, 0}, b{2, 0.5, 0};
  const auto once = estimate_motion(model, std::vector{a, b}, 0);
  const auto twice = estimate_motion(model, std::vector{a, a, b, b}, 0);
  ASSERT_TRUE(once && twice);
  EXPECT_EQ(twice->modelled_j, once->modelled_j);
  EXPECT_EQ(twice->duration_s, 2);
  const auto instant = estimate_motion(model, std::vector{a, a}, 0);
  ASSERT_FALSE(instant);
  EXPECT_EQ(instant.error().field, "time_s");
}

}  // namespace
}  // namespace joulecast::energy
