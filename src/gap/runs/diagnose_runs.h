#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/runs/run_table.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// One run: its measured energy, and the model's, as it is and with the effects found.
struct JudgedRun {
  MissionRun run;
  double model_j = 0;
  double after_j = 0;     // with the causes, fitted to all runs
  double held_out_j = 0;  // with the causes named and fitted without this run
};

// The diagnosis from the energies of runs and their conditions alone.
struct RunDiagnosis {
  // As of recordings, of the mean power of runs; samples are runs.
  Diagnosis diagnosis;
  bool model_given = false;  // the table contains the model's energies; otherwise they are the robot file's
  double model_ratio = 1;    // of the given energies to those of the robot file under the conditions
  double scatter = 0,
         side_scatter = 0;          // from run to run, sd relative to a run's energy; of right minus left
  std::vector<std::string> limits;  // limits of these energies, in sentences
  std::vector<JudgedRun> runs;
};

// Diagnoses the energies of runs; `robot_file_model`: by the robot file even where runs contain a model's
// energies. Fault::invalid for a robot with adopted effects that the catalogue rejects.
Result<RunDiagnosis> diagnose_runs(const RunSet& runs, const robot::RobotModel& robot,
                                   bool robot_file_model = false, const Progress& progress = {});

// Returns the JSON that `joulecast gap --missions --json` prints: a diagnosis's JSON, `kind`
// "mission_energies", and the fields of runs.
nlohmann::ordered_json runs_to_json(const RunDiagnosis& diagnosis);

}  // namespace joulecast::gap
