#include "dynamics/drive_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/dynamics/random_motion.h"
#include "tests/support/sample_robots.h"

namespace joulecast::dynamics {
namespace {

// Power of one wheel on a straight line, FACTS: P = rho (J a + nu w + T)^2 + kappa w (J a + nu w + T).
TEST(DriveModel, StraightLineMatchesClosedForm) {
  const robot::RobotModel robot = testing::nomad();
  const DriveModel model(robot, {});
  const double kn = 0.069 * 24.9, rho = 2.74 / (kn * kn), payload = 5.7;
  const double inertia = 0.028 + (21.2 + 2 * 1.39 + payload) * 0.1 * 0.1 / 2;
  for (double w : {0.5, 3.0, 8.0}) {
    for (double a : {-2.0, 0.0, 1.5}) {
      Instant at;
      at.wheel_speed_rad_s = {w, w};
      at.wheel_acceleration_rad_s2 = {a, a};
      at.payload_kg = payload;
      const auto flow = model.flow(at);
      for (std::size_t s : {0u, 1u}) {
        const double torque = inertia * a + 0.0017 * w + robot.motor.friction_torque_nm[s];
        const double power = rho * torque * torque + w * torque;
        // The friction's smooth sign departs from one by (width / w)^2 / 2.
        EXPECT_NEAR(flow.motor_power_w[s], power, 1e-4 * std::fabs(power) + 1e-4);
      }
    }
  }
}

// The kinetic term is the rate of the kinetic energy (2-12), d = 0.03 m included, recomputed by finite
// differences.
TEST(DriveModel, KineticTermMatchesKineticEnergy) {
  robot::RobotModel robot = testing::nomad();
  robot.kinematics.com_offset_m = 0.03;
  const DriveModel model(robot, {});
  std::mt19937 random(5);
  const auto energy = [&](double w1, double w2, double payload) {
    const double v = 0.1 * (w1 + w2) / 2, yaw = 0.1 * (w1 - w2) / (2 * 0.165);
    const double mass = 21.2 + 2 * 1.39 + payload;
    // In the body frame the coupling term of (2-12) is m_c d yaw times the lateral speed, which is zero.
    return 0.5 * mass * v * v + 0.5 * (0.75 + 0.02 * payload) * yaw * yaw + 0.5 * 0.028 * (w1 * w1 + w2 * w2);
  };
  for (int k = 0; k < 100; ++k) {
    const Instant at = testing::random_motion(random);
    const auto& w = at.wheel_speed_rad_s;
    const auto& a = at.wheel_acceleration_rad_s2;
    const double h = 1e-5;
    const double rate = (energy(w[0] + h * a[0], w[1] + h * a[1], at.payload_kg) -
                         energy(w[0] - h * a[0], w[1] - h * a[1], at.payload_kg)) /
                        (2 * h);
    Instant still = at;
    still.current_slope_a_s = {};
    EXPECT_NEAR(model.flow(still).ledger[signals::Term::kinetic], rate, 1e-7 * (1 + std::fabs(rate)));
  }
}

TEST(DriveModel, WheelsAndBodyAreInverse) {
  const DriveModel model(testing::nomad(), {});
  const auto wheels = wheels_of_body(model.parameters(), 0.7, -0.4);
  const auto body = body_of_wheels(model.parameters(), wheels, {});
  EXPECT_NEAR(body.speed_m_s, 0.7, 1e-15);
  EXPECT_NEAR(body.yaw_rate_rad_s, -0.4, 1e-15);
  // (2-49) with l half the track: the right wheel of a left turn runs faster by 2 l yaw / r.
  const auto left_turn = wheels_of_body(model.parameters(), 0, 1);
  EXPECT_NEAR(left_turn[0] - left_turn[1], 2 * 0.165 / 0.1, 1e-14);
}

TEST(DriveModel, UnreturnedPowerBypassesTheBattery) {
  ActiveEffect none = initial(*find_effect("no_regeneration"));
  none.values[0] = 1;
  const DriveModel model(testing::nomad(), {&none, 1});
  Instant at;
  at.wheel_speed_rad_s = {6, 6};
  at.wheel_acceleration_rad_s2 = {-4, -4};
  const auto flow = model.flow(at);
  ASSERT_LT(flow.motor_power_w[0], 0);
  EXPECT_DOUBLE_EQ(flow.battery_power_w, 14);
  EXPECT_EQ(flow.ledger[signals::Term::recovered], 0);
  EXPECT_GT(flow.ledger[signals::Term::braking], 0);
}

TEST(DriveModel, RejectsABadEffect) {
  robot::RobotModel robot = testing::nomad();
  robot.effects.push_back({"slope", {{"angle_rad", 4}}});
  const auto model = drive_model(robot);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().field, "/effects/slope/angle_rad");
}

}  // namespace
}  // namespace joulecast::dynamics
