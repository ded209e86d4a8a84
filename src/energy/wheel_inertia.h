#pragma once

#include "robot/robot_model.h"

namespace joulecast::energy {

// Inertia of an empty robot at each wheel's motor [kg m^2].
struct WheelInertia {
  double straight = 0;  // both wheels with the same acceleration: m r^2/2 + I_w + I_s
  double turning = 0;   // they accelerate oppositely: 2 I c^2 + I_w + I_s, c = r/(2l)
};

WheelInertia wheel_inertia(const robot::RobotModel& robot);

// Gives a robot this inertia [kg m^2]. Motion shows only the sums, so the rotor takes the inertia that the
// file's mass does not explain; where the rotor's would be negative, the chassis is made lighter, down to a
// hundredth of its mass. A turning inertia below that of wheels and rotors leaves the yaw inertia unchanged.
void place_straight_inertia(double straight_kg_m2, robot::RobotModel& robot);
void place_turning_inertia(double turning_kg_m2, robot::RobotModel& robot);

}  // namespace joulecast::energy
