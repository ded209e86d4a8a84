#pragma once

#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "gap/run_energy.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// A mission of which only its energy and its conditions are known. NaN: not given.
struct MissionRun {
  static constexpr double absent = std::numeric_limits<double>::quiet_NaN();

  std::string label;
  std::string table;  // runs of one table (one day, one floor, one driver) share what scatters between tables
  RunConditions at;
  double energy_j = absent;                       // measured at the battery, idle power included
  std::array<double, 2> motor_j{absent, absent};  // or measured at each motor, [0] right, [1] left
  double model_energy_j = absent;                 // by the model in question, where its answer is at hand
  std::array<double, 2> model_motor_j{absent, absent};

  bool by_motor() const { return motor_j[0] == motor_j[0]; }
  double measured_j() const { return by_motor() ? motor_j[0] + motor_j[1] : energy_j; }
};

// One column of a table of runs.
struct RunColumn {
  std::string_view name;
  std::string_view unit;
  std::string_view meaning;
};

// The header that read_mission_runs understands, in any order; others are errors.
std::vector<RunColumn> run_columns();

// Reads runs from CSV. An error's field is "<name>: line N" and its message names the column. The robot's
// limit stands in for an acceleration that is not given. At least 3 runs, at most 1000.
Result<std::vector<MissionRun>> read_mission_runs(std::string_view csv, const std::string& name,
                                                  const robot::RobotModel& robot);

}  // namespace joulecast::gap
