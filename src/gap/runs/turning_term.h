#pragma once

#include <optional>
#include <span>

#include "gap/runs/run_table.h"

namespace joulecast::gap {

// Test for wheel speeds computed as (2v +- l yaw)/(2r) with l half the track, thesis (3-6), as the cause of
// the difference between the sides: their turning term is half of the right one.
struct TurningTerm {
  std::size_t runs = 0;
  double side_difference = 0;      // mean size of the term, relative to a run's energy
  double sum = 0;                  // its change of the sum of both motors, likewise
  double share = 0, share_sd = 0;  // of the term found in the measured side differences: 1 if it is halved
  double motor_error_before = 0, motor_error_after = 0;  // mean absolute, of single motors, in turns
};

// Estimates the term from the runs with a turn, energies of both motors and of a model for them; nothing with
// fewer than two.
std::optional<TurningTerm> turning_term(std::span<const MissionRun> runs, const robot::RobotModel& robot);

}  // namespace joulecast::gap
