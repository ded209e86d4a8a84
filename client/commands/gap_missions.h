#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/commands/outcome.h"
#include "robot/robot_model.h"

namespace joulecast::client {

struct GapMissionsOptions {
  std::vector<std::string> runs;  // CSV files
  std::string compare_by;         // label of the groups to compare; empty: one diagnosis
  std::string robot_file;
  bool robot_model = false;  // diagnose the robot file, not the energies of a model in the table
  bool json = false;
  std::string report;               // HTML file to write; empty: none
  std::string apply;                // robot file to write; empty: none
  std::vector<std::string> effect;  // to take of those that are not distinguished
  bool force = false;               // write in spite of the diagnosis's refusal
};

// Diagnoses the gap from energies of whole runs.
Exit gap_from_missions(const GapMissionsOptions& options, const robot::RobotModel& robot);

// The columns of the CSV file, for the help.
std::string run_columns_help();

}  // namespace joulecast::client
