#include "tests/study/exploration/mission_energy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "dynamics/drive_model.h"
#include "planning/line.h"
#include "tests/support/sample_robots.h"

namespace joulecast::exploration {
namespace {

TEST(MissionEnergy, TriangleIntegratesTheDriveModel) {
  const robot::RobotModel robot = testing::nomad();
  const dynamics::DriveModel model(robot, std::span<const dynamics::ActiveEffect>{});
  const std::vector<Motion> motions{Straight{{1, 1}, {4, 5}}};
  const auto energy = mission_energy(robot, motions, {.payload_kg = 5.7, .turn_rate_rad_s = {}});
  ASSERT_TRUE(energy);
  EXPECT_NEAR(energy->triangle.duration_s, 10, 1e-12);
  EXPECT_NEAR(energy->triangle.peak_speed_m_s, 1, 1e-12);
  // Midpoint rule; the model rounds the sign of dry friction off below a wheel speed of 0.005 rad/s, which
  // lasts 2.5 ms at either end and is worth less than 2.5 ms of c0 and the accelerating term, 4 W.
  double sum = 0;
  constexpr int steps = 200000;
  for (int k = 0; k < steps; ++k) {
    const double t = 10 * (k + 0.5) / steps;
    dynamics::Instant at;
    const double speed = t < 5 ? t / 5 : (10 - t) / 5, acceleration = t < 5 ? 0.2 : -0.2;
    at.wheel_speed_rad_s = {speed / 0.1, speed / 0.1};
    at.wheel_acceleration_rad_s2 = {acceleration / 0.1, acceleration / 0.1};
    at.payload_kg = 5.7;
    const auto flow = model.flow(at);
    sum += (flow.motor_power_w[0] + flow.motor_power_w[1]) * 10 / steps;
  }
  EXPECT_NEAR(energy->triangle.energy_j, sum, 2 * 0.0025 * 4);
}

TEST(MissionEnergy, TurnsHaveConstantPower) {
  const robot::RobotModel robot = testing::nomad();
  const std::vector<Motion> motions{Turn{1.2}, Turn{-0.7}};
  const auto energy = mission_energy(robot, motions, {.payload_kg = 0, .turn_rate_rad_s = 0.9});
  ASSERT_TRUE(energy);
  // By hand: each wheel at w = l rate / r, P = R (T/(K n))^2 + (K_w/K_t) w T with T = nu w + T_m.
  const double w = 0.165 * 0.9 / 0.1, kn = 0.069 * 24.9;
  double power = 0;
  for (const double friction : {0.3728, 0.346}) {
    const double torque = 0.0017 * w + friction;
    power += 2.74 * torque * torque / (kn * kn) + w * torque;
  }
  EXPECT_NEAR(energy->turns.duration_s, 1.9 / 0.9, 1e-12);
  // The model's smooth sign of dry friction differs from one by (0.005/w)^2/2, in the torque and in its
  // square.
  EXPECT_NEAR(energy->turns.energy_j, power * 1.9 / 0.9, power * 1.9 / 0.9 * std::pow(0.005 / w, 2));
  EXPECT_EQ(energy->triangle.energy_j, 0);
  EXPECT_EQ(energy->optimal.energy_j, 0);
}

TEST(MissionEnergy, OptimumIsCheapest) {
  const robot::RobotModel robot = testing::nomad();
  std::map<int, double> optimal;
  for (int number = 1; number <= thesis_case_count; ++number) {
    const auto explored = explore(*thesis_case(number));
    ASSERT_TRUE(explored);
    double last_optimal = 0, last_triangle = 0;
    for (const double payload : {0.0, 5.7, 10.5}) {
      const auto energy =
          mission_energy(robot, explored->motions, {.payload_kg = payload, .turn_rate_rad_s = {}});
      ASSERT_TRUE(energy);
      EXPECT_GT(energy->saving(), 0);
      EXPECT_GT(energy->optimal_total_j(), last_optimal);
      EXPECT_GT(energy->triangle_total_j(), last_triangle);
      last_optimal = energy->optimal_total_j();
      last_triangle = energy->triangle_total_j();
      if (payload == 0) optimal[number] = last_optimal;
    }
  }
  // The order of table 5-4: cases 1 and 4 dearest, cases 3 and 5 below both.
  for (const int dear : {1, 4})
    for (const int cheap : {2, 3, 5}) EXPECT_LT(optimal[cheap], optimal[dear]) << cheap << " " << dear;
}

TEST(MissionEnergy, CountsIdlePowerOfTheRobot) {
  robot::RobotModel robot = testing::nomad();
  robot.idle_power_w = 9;
  const std::vector<Motion> motions{Straight{{0, 0}, {4, 0}}, Turn{1.5}};
  const auto motors = mission_energy(robot, motions, {});
  const auto battery = mission_energy(robot, motions, {.turn_rate_rad_s = {}, .idle = true});
  ASSERT_TRUE(motors && battery);
  EXPECT_NEAR(battery->triangle.energy_j, motors->triangle.energy_j + 9 * motors->triangle.duration_s, 1e-9);
  EXPECT_NEAR(battery->turns.energy_j, motors->turns.energy_j + 9 * motors->turns.duration_s, 1e-9);
  // What the battery pays for the drive that is cheapest for the motors alone.
  EXPECT_LT(battery->optimal.energy_j, motors->optimal.energy_j + 9 * motors->optimal.duration_s);
  EXPECT_LT(battery->optimal.energy_j, battery->triangle.energy_j);
  EXPECT_LT(battery->optimal.duration_s, motors->optimal.duration_s);
}

TEST(MissionEnergy, IdlePowerBoundsTheBestTime) {
  robot::RobotModel robot = testing::nomad();
  robot.motor.friction_torque_nm = {0, 0};
  const std::vector<Motion> motions{Straight{{0, 0}, {4, 0}}};
  EXPECT_FALSE(mission_energy(robot, motions, {}));
  EXPECT_TRUE(mission_energy(robot, motions, {.turn_rate_rad_s = {}, .idle = true}));
}

TEST(MissionEnergy, SavesMoreOnShorterLegs) {
  const robot::RobotModel robot = testing::nomad();
  double last = 0;
  for (const double size : {4.0, 2.0, 1.0, 0.5}) {
    const std::vector<Motion> motions{Straight{{0, 0}, {size, 0}}};
    const double saving = mission_energy(robot, motions, {})->saving();
    EXPECT_GT(saving, last);
    last = saving;
  }
}

TEST(MissionEnergy, NamesTheFault) {
  const robot::RobotModel robot = testing::nomad();
  const std::vector<Motion> motions{Turn{1}};
  EXPECT_EQ(mission_energy(robot, motions, {.payload_kg = -1, .turn_rate_rad_s = {}}).error().field,
            "payload_kg");
  EXPECT_EQ(mission_energy(robot, motions, {.payload_kg = 11, .turn_rate_rad_s = {}}).error().field,
            "payload_kg");
  EXPECT_EQ(mission_energy(robot, motions, {.payload_kg = 0, .turn_rate_rad_s = 0}).error().field,
            "turn_rate_rad_s");
  EXPECT_EQ(mission_energy(robot, motions, {.payload_kg = 0, .triangle_peak_m_s = -1, .turn_rate_rad_s = {}})
                .error()
                .field,
            "triangle_peak_m_s");
}

}  // namespace
}  // namespace joulecast::exploration
