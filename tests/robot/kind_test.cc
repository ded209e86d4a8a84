#include <gtest/gtest.h>

#include "robot/robot_fields.h"
#include "robot/robot_file.h"

namespace joulecast::robot {
namespace {

RobotModel shipped_kind(const std::string& name) {
  return load_robot(std::string(JOULECAST_SOURCE_DIR "/deploy/robots/") + name + ".json").value();
}

TEST(Kind, CalibrationKeepsKind) {
  const RobotModel file = shipped_kind("amr");
  RobotModel other = file;
  other.robot_id = "other";
  other.idle_power_w = 30;
  other.effects = {{"coulomb_friction", {{"strength", 0.1}}}};
  other.motor.friction_torque_nm = {1.1, 1.2};
  other.motor.viscous_friction_nm_s_rad *= 2;
  other.motor.resistance_ohm *= 1.1;
  other.motor.torque_constant_nm_a *= 1.02;
  other.motor.voltage_constant_v_s_rad *= 1.02;
  other.motor.rotor_inertia_kg_m2 *= 1.1;
  other.kinematics = {1.01 * file.kinematics.wheel_radius_m, 0.99 * file.kinematics.half_track_m, 0.01};
  other.mass.chassis_kg += 3;
  other.mass.yaw_inertia_kg_m2 *= 1.1;
  other.battery.internal_resistance_ohm *= 1.5;
  other.battery.ageing_factor = 0.9;
  EXPECT_EQ(kind_of(file), kind_of(other));
}

TEST(Kind, DiffersBetweenTheShippedRobots) {
  EXPECT_NE(kind_of(shipped_kind("amr")), kind_of(shipped_kind("tug")));
  EXPECT_NE(kind_of(shipped_kind("frc3314-high")), kind_of(shipped_kind("frc3314-low")));
}

}  // namespace
}  // namespace joulecast::robot
