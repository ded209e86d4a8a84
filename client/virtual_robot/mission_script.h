#pragma once

#include <variant>
#include <vector>

#include "client/virtual_robot/rng.h"
#include "client/virtual_robot/robot_parameters.h"

namespace joulecast::virtual_robot {

// Drive straight towards a point of the map.
struct GoTo {
  double x_m, y_m;
  double speed_m_s, acceleration_m_s2;
};
// Turn in place until the nose points at a point of the map.
struct TurnTo {
  double x_m, y_m;
  double rate_rad_s, acceleration_rad_s2;
};
// Drive an arc; angle positive to the left.
struct Arc {
  double radius_m, angle_rad;
  double speed_m_s, acceleration_m_s2;
};
struct Dwell {
  double duration_s;
};
// Unload the payload and load this much.
struct Load {
  double payload_kg;
};

using Leg = std::variant<GoTo, TurnTo, Arc, Dwell, Load>;

struct MissionScript {
  double payload_kg = 0;     // declared at the start
  double undeclared_kg = 0;  // carried besides, all the way
  std::vector<Leg> legs;
};

struct ScriptOptions {
  double map_half_width_m = 8;    // the walls stand at +- this in x and y
  double clearance_m = 1.2;       // that planned points keep from the walls
  double duration_s = 110;        // of a mission, about; legs are added until it is reached
  double slowest_fraction = 0.3;  // of the speed limit, cruise
  double fastest_fraction = 0.9;
  double gentlest_fraction = 0.35;  // of the acceleration limit
  double hardest_fraction = 0.95;
  double arc_share = 0.2;     // of the legs
  double dwell_share = 0.25;  // of the legs are followed by a halt
  double shortest_halt_s = 1;
  double longest_halt_s = 4;
  double pickup_share = 0;       // of the halts change the payload
  double undeclared_share = 0;   // of the missions carry more than they declare ...
  double undeclared_most = 0.6;  // ... by a quarter of this to all of it, of the payload limit
  bool manoeuvre = false;        // every mission is the calibration drive
};

// Where a script begins and, after planning, where it ends.
struct ScriptPose {
  double x_m = 0, y_m = 0, heading_rad = 0;
};

// A mission that stays within the walls, planned from `pose`, which moves on to its end.
[[nodiscard]] MissionScript plan_mission(const RobotParameters& robot, const ScriptOptions& options,
                                         ScriptPose& pose, Rng& rng);

}  // namespace joulecast::virtual_robot
