#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "robot/robot_model.h"

// Reference for plans: minimum energy by direct transcription, solved by IPOPT. Its kinematics, drive and
// transcription are written from the thesis's equations; it shares only robot files with the product.
namespace joulecast::oracle {

// One run between stops. Its coordinate is the way [m], or the angle turned in place [rad].
struct Way {
  bool turns_in_place = false;
  double length = 0;
  // Curvature over the way, linear between its samples, constant beyond them; none: straight.
  std::vector<double> at;
  std::vector<double> curvature_1_m;
};

struct Question {
  robot::RobotModel robot;
  Way way;
  double payload_kg = 0;
  double start_speed = 0, end_speed = 0;  // of the coordinate
  double regeneration = 1;                // share of braking power that the battery takes
  double driver_loss = 0;                 // of the motors' absolute power
  double scrub = 0, scrub_rate_rad_s = 0.02;
  double gear_loss = 0;         // of the torque that the gear passes on, at any direction of power
  double gear_of_friction = 0;  // share of the motors' friction that it passes on
  double value_of_time_w = 0;
  std::optional<double> deadline_s;
  double speed_m_s = std::numeric_limits<double>::infinity();
  double acceleration_m_s2 = std::numeric_limits<double>::infinity();  // in place: of the rims
  double yaw_rate_rad_s = std::numeric_limits<double>::infinity();
  double current_a = std::numeric_limits<double>::infinity();
  double voltage_v = std::numeric_limits<double>::infinity();
  bool fastest = false;  // minimise the duration alone
  double gentle = 0.2;   // of the acceleration limit, where the search begins: power is not always convex
  int cells = 150;
  // Whether the motors' limits hold at the ends of cells too. Else at their middles alone: the cost then
  // comes near the least as the square of a cell's size, from either side.
  bool strict = true;
};

// A motion of constant acceleration between the nodes. Where the question is strict it can be driven exactly,
// so that its cost is never below the least but by IPOPT's tolerance.
struct Found {
  bool solved = false;
  double energy_j = 0, duration_s = 0;
  double cost_j = 0;  // energy + value of time * duration
  std::vector<double> way, speed;
};

Found least_energy(const Question& question);
// Begins at a motion.
Found least_energy(const Question& question, const Found& from);

// The drive at an instant: currents, voltages, and power at the battery.
struct Drive {
  double current_a[2], voltage_v[2];
  double battery_w;
};
Drive drive_at(const Question& question, double way, double speed, double acceleration);

}  // namespace joulecast::oracle
