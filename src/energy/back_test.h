#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "energy/calibration.h"
#include "robot/robot_model.h"

namespace joulecast::energy {

// Compares the predictions of two models with the measurements of recorded runs: the meter replays every run
// with both. Energies are those at the battery where the battery was measured, else those at the motors.

// One model on one run.
struct ModelError {
  double energy_j = 0;                 // modelled where measured
  double relative = 0;                 // energy_j / measured_j - 1
  double power_absolute_relative = 0;  // |modelled - measured| energy of each half second, over that measured
  std::array<double, 2> interval{unknown, unknown};  // of `relative`, 95 %, by the blocks of the run

  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
};

struct RunComparison {
  std::string name;
  std::optional<std::int64_t> id;  // where the caller has one
  bool at_battery = true;
  double measured_j = 0;
  double duration_s = 0;  // measured
  ModelError before, after;
};

// Over all runs, weighted by measured energy: sum |energy error| / sum measured energy, and the power gap
// (power_absolute_relative), which unlike the former cannot be small because errors of either sign cancel.
// The voltage gap is that of the battery's voltage from one half second to the next by its current and
// resistance, over what was measured. 95 % intervals of the decreases: runs on which the models differ are
// drawn with replacement, and blocks within each; the other runs are always included. NaN without runs.
struct BackTest {
  std::vector<RunComparison> runs;
  double error_before = 0;
  double error_after = 0;
  std::array<double, 2> improvement_interval{};
  double power_gap_before = 0;
  double power_gap_after = 0;
  std::array<double, 2> power_gap_fall_interval{};
  double voltage_gap_before =
      ModelError::unknown;  // unknown: the battery's voltage or current was not measured
  double voltage_gap_after = ModelError::unknown;
  std::array<double, 2> voltage_gap_fall_interval{ModelError::unknown, ModelError::unknown};

  double improvement() const { return error_before - error_after; }
  // One of the three decreases significantly (its whole interval is above zero) while the others do not grow:
  // the gaps not at all, the energy error not significantly. False without runs.
  bool improves() const;
};

struct BackTestSettings {
  MeterSettings meter;
  double block_s = 10;  // of the bootstrap; errors within it belong together
  int draws = 1000;     // of the bootstrap
  // Comparisons among which this is one: intervals of the decreases are those of 95 % for all (Bonferroni).
  std::size_t comparisons = 1;
  double least_duration_s = 5;  // measured; shorter runs are omitted
  double least_energy_j = 10;   // measured; below, a relative error is meaningless
  std::function<bool()> go_on;  // called before each run; false stops with Fault::conflict
};

// Replays the runs with both models; runs that measure too little are left out of the result. Fault::invalid
// for a model that the catalogue of effects rejects.
Result<BackTest> back_test(std::span<const DriveRun> runs, const robot::RobotModel& before,
                           const robot::RobotModel& after, const BackTestSettings& settings = {});

}  // namespace joulecast::energy
