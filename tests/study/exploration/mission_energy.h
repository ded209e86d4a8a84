#pragma once

#include <optional>
#include <span>

#include "base/error.h"
#include "robot/robot_model.h"
#include "tests/study/exploration/explore.h"

namespace joulecast::exploration {

struct MissionOptions {
  double payload_kg = 0;
  double triangle_peak_m_s = 1;           // thesis 5.5
  std::optional<double> turn_rate_rad_s;  // of every turn in place; unset: the robot's limit
  bool idle = false;                      // the energy of the battery, with the robot's idle power
};

struct Spent {
  double energy_j = 0;
  double duration_s = 0;
  double peak_speed_m_s = 0;
};

// Energy of one exploration, as the thesis accounts for it (5.5): every straight from rest to rest, every
// turn at a constant rate, adopted effects left out; of the motors, or with `idle` of the battery.
struct MissionEnergy {
  double payload_kg = 0;
  double turn_rate_rad_s = 0;
  Spent turns;     // the same under either profile; peak speed 0
  Spent triangle;  // straights: accelerating half the time, braking the other
  Spent optimal;   // straights: minimum energy in free time, thesis (4-9), (4-13)

  double triangle_total_j() const { return turns.energy_j + triangle.energy_j; }
  double optimal_total_j() const { return turns.energy_j + optimal.energy_j; }
  double saving() const { return 1 - optimal_total_j() / triangle_total_j(); }
};

Result<MissionEnergy> mission_energy(const robot::RobotModel& robot, std::span<const Motion> motions,
                                     const MissionOptions& options);

}  // namespace joulecast::exploration
