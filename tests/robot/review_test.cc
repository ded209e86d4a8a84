#include "robot/review.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "robot/robot_file.h"

namespace joulecast::robot {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

RobotModel shipped_for_review(const std::string& name) {
  return load_robot(std::string(JOULECAST_SOURCE_DIR "/deploy/robots/") + name + ".json").value();
}

std::vector<std::string> fields_of(const RobotModel& model) {
  std::vector<std::string> fields;
  for (const ReviewFinding& finding : review(model)) fields.push_back(finding.field);
  return fields;
}

TEST(Review, AcceptsShippedRobots) {
  for (const char* name : {"amr", "tug", "nomad", "p3dx", "borealtc-husky", "frc3314-high", "frc3314-low"})
    EXPECT_THAT(fields_of(shipped_for_review(name)), IsEmpty()) << name;
  // The idle power of 1 W is a placeholder.
  EXPECT_THAT(fields_of(shipped_for_review("warthog-grass")), ElementsAre("/idle_power_w"));
}

// Integrators' mistakes, each in an otherwise correct robot file.
TEST(Review, NamesFaultyField) {
  const auto mistaken = [](auto mistake) {
    RobotModel model = shipped_for_review("amr");
    mistake(model);
    EXPECT_TRUE(validate(model));
    return fields_of(model);
  };
  EXPECT_THAT(mistaken([](RobotModel& m) { m.motor.gear_ratio = 1; }), Contains("/motor/gear_ratio"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.battery.nominal_voltage_v = 20; }),
              Contains("/limits/speed_m_s"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.battery.capacity_ah = 20'000; }),
              Contains("/battery/capacity_ah"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.battery.internal_resistance_ohm = 1.9; }),
              Contains("/battery/internal_resistance_ohm"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.motor.inductance_h = 0.42; }), Contains("/motor/inductance_h"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.motor.torque_constant_nm_a *= 2; }),
              Contains("/motor/torque_constant_nm_a"));
  EXPECT_THAT(mistaken([](RobotModel& m) {
                m.motor.friction_torque_nm = {8.4, 8.8};
              }),
              Contains("/motor/friction_torque_nm"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.limits.yaw_rate_rad_s = 90; }),
              Contains("/limits/yaw_rate_rad_s"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.limits.acceleration_m_s2 = 15; }),
              Contains("/limits/acceleration_m_s2"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.idle_power_w = 0; }), Contains("/idle_power_w"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.mass.yaw_inertia_kg_m2 = 400; }),
              Contains("/mass/yaw_inertia_kg_m2"));
  EXPECT_THAT(mistaken([](RobotModel& m) { m.motor.rotor_inertia_kg_m2 = 2; }),
              Contains("/motor/rotor_inertia_kg_m2"));
}

TEST(Review, TopSpeedFollowsMotorEquations) {
  RobotModel model = shipped_for_review("amr");
  model.limits.speed_m_s = 5;
  const auto findings = review(model);
  ASSERT_THAT(findings, Contains(::testing::Field(&ReviewFinding::field, "/limits/speed_m_s")));
  // n K_t i = T + nu w and V = R i + K_w n w, by hand: w = (25.6 - 0.38 * 0.88 / 1.155) / (1.155 + 0.38 *
  // 0.02 / 1.155).
  EXPECT_NEAR(findings[0].value, 0.08 * 25.31048 / 1.16158, 1e-4);
  EXPECT_FALSE(findings[0].fault);
  EXPECT_THAT(findings[0].says, HasSubstr("1.74 m/s"));
}

TEST(Review, RejectsImmobileRobots) {
  EXPECT_TRUE(plannable(review(shipped_for_review("amr"))));
  RobotModel stuck = shipped_for_review("amr");
  stuck.motor.resistance_ohm = 500;
  EXPECT_EQ(plannable(review(stuck)).error().field, "/motor/resistance_ohm");
  RobotModel weak = shipped_for_review("amr");
  weak.limits.current_a = 0.5;  // 0.88 N m / (0.055 N m/A * 21) = 0.76 A
  EXPECT_EQ(plannable(review(weak)).error().field, "/limits/current_a");
  EXPECT_EQ(plannable(review(weak)).error().fault, Fault::invalid);
  // The robot is slow but moves.
  RobotModel slow = shipped_for_review("amr");
  slow.motor.gear_ratio = 2000;
  EXPECT_TRUE(plannable(review(slow)));
  EXPECT_THAT(fields_of(slow), Contains("/limits/speed_m_s"));
}

}  // namespace
}  // namespace joulecast::robot
