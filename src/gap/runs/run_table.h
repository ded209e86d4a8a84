#pragma once

#include <array>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "gap/runs/run_energy.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// A mission with its energy and its conditions alone. NaN: not given.
struct MissionRun {
  static constexpr double absent = std::numeric_limits<double>::quiet_NaN();

  std::string name;
  std::string table;  // runs of one table (one day, one driver) have a common deviation
  RunConditions at;
  double energy_j = absent;                       // measured at the battery, idle power included
  std::array<double, 2> motor_j{absent, absent};  // or measured at each motor, [0] right, [1] left
  double model_energy_j = absent;                 // by the model in question, where its answer is available
  std::array<double, 2> model_motor_j{absent, absent};
  std::vector<double> covariates;   // in the order of RunSet::covariates
  std::vector<std::string> labels;  // in the order of RunSet::labels; empty: not given

  bool by_motor() const { return motor_j[0] == motor_j[0]; }
  double measured_j() const { return by_motor() ? motor_j[0] + motor_j[1] : energy_j; }
  // Energy by the model in question, of both motors or the battery; NaN: not given.
  double given_j() const { return by_motor() ? model_motor_j[0] + model_motor_j[1] : model_energy_j; }
};

// Runs of one robot, of one table or many.
struct RunSet {
  std::vector<MissionRun> runs;
  std::vector<std::string> covariates, labels;  // names

  // Returns the runs' label of that name; Fault::invalid with the available labels where no table has it, or
  // a run lacks it. "table" is a label that all runs have.
  Result<std::vector<std::string>> groups_by(std::string_view label) const;
};

// One column of a table of runs.
struct RunColumn {
  std::string_view name;
  std::string_view unit;
  std::string_view meaning;
};

// The columns that read_runs accepts, in any order; others are errors.
std::vector<RunColumn> run_columns();

struct RunFile {
  std::string name, text;
};

// Reads runs from CSV tables. An error's field is "<name>: line N" and its message names the column. A
// missing acceleration is replaced by the robot's limit and, with several files, a missing table by the
// file's name. At least 3 runs, at most 1000.
Result<RunSet> read_runs(std::span<const RunFile> files, const robot::RobotModel& robot);

}  // namespace joulecast::gap
