#pragma once

#include <array>
#include <vector>

#include "dynamics/drive_model.h"
#include "windows/windows.h"

namespace joulecast::gap {

// The conditions of one run, driven from rest to rest: straight, or with an arc in the middle of the way.
struct RunConditions {
  double distance_m = 0;
  double speed_m_s = 0;                // reached at the end of the acceleration, if the distance allows it
  double acceleration_m_s2 = 0;        // of starting and of braking
  double payload_kg = 0;               // declared
  double turn_rad = 0;                 // change of heading, positive to the left; 0: straight
  double turn_radius_m = 0;            // mean radius of the arc; unused without a turn
  double standstill_s = 0;             // with the robot on, before or after
  double climb_m = dynamics::unknown;  // by which it ends higher, evenly over the distance
};

struct RunEnergy {
  std::array<double, 2> motor_j{};  // integral of V i as the motors' sensors read it, [0] right, [1] left
  double battery_j = 0;             // as the battery's sensor reads it, idle power included
  double duration_s = 0;
};

// The motion of a run with trapezoidal speed: the middles of even steps of each phase, wheels and warmth of
// the windings by this model. The arc's curvature rises and falls linearly over a tenth of its length, so
// that the yaw acceleration stays finite.
std::vector<windows::Window> run_instants(const dynamics::DriveModel& model, const RunConditions& run);

// Energy of a run by a drive model: the sum over these steps.
RunEnergy run_energy(const dynamics::DriveModel& model, const RunConditions& run);

}  // namespace joulecast::gap
