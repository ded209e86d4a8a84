#include "energy/wheel_inertia.h"

#include <algorithm>

namespace joulecast::energy {
namespace {

double turning_arm(const robot::RobotModel& robot) {
  return robot.kinematics.wheel_radius_m / (2 * robot.kinematics.half_track_m);
}

}  // namespace

WheelInertia wheel_inertia(const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, c = turning_arm(robot);
  const double wheel = robot.mass.wheel_inertia_kg_m2 + robot.motor.rotor_inertia_kg_m2;
  return {robot.total_mass_kg(0) * r * r / 2 + wheel, 2 * robot.mass.yaw_inertia_kg_m2 * c * c + wheel};
}

void place_straight_inertia(double straight_kg_m2, robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m;
  const double rotor = straight_kg_m2 - robot.total_mass_kg(0) * r * r / 2 - robot.mass.wheel_inertia_kg_m2;
  robot.motor.rotor_inertia_kg_m2 = std::max(rotor, 0.0);
  if (rotor >= 0) return;
  const double mass = 2 * (straight_kg_m2 - robot.mass.wheel_inertia_kg_m2) / (r * r);
  robot.mass.chassis_kg = std::max(mass - 2 * robot.mass.wheel_kg, 0.01 * robot.mass.chassis_kg);
}

void place_turning_inertia(double turning_kg_m2, robot::RobotModel& robot) {
  const double c = turning_arm(robot);
  const double yaw =
      (turning_kg_m2 - robot.mass.wheel_inertia_kg_m2 - robot.motor.rotor_inertia_kg_m2) / (2 * c * c);
  if (yaw > 0) robot.mass.yaw_inertia_kg_m2 = yaw;
}

}  // namespace joulecast::energy
