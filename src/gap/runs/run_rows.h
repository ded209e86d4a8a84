#pragma once

#include <vector>

#include "gap/posterior/data.h"
#include "gap/runs/run_table.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// A table of runs as rows of the posterior: the energy of a run over its duration, relative to its energy.
struct RunRows {
  RunRows(const RunSet& set, const robot::RobotModel& robot, std::vector<dynamics::ActiveEffect> in_file);

  // Energy of each run for these powers of the rows [J]; where a run has energies of a model, they change
  // those.
  std::vector<double> energies_j(const Eigen::VectorXd& power_w) const;
  // Returns the energies by the model as it is.
  std::vector<double> modelled_j() const;
  // Error of an energy, relative to the measured or the predicted one, whichever is larger.
  double missed(std::size_t run, double energy_j) const;
  // Energies of all runs by a linear regression, and the residual of each run over their spread.
  struct Regression {
    std::vector<double> energy_j, apart;
  };
  Regression regression() const;
  // Reduces the weight of these runs to almost zero from now on.
  void silence(const std::vector<std::size_t>& wrong);

  std::vector<MissionRun> runs;
  posterior::Data data;
  // Of each run: J for one W of its row, the given model minus the robot file's (energy that is not in its
  // power), the reference of relative errors.
  std::vector<double> joule, offset_j, size_j, duration_s;
  bool by_motor = true;  // all runs were measured motor by motor
  bool model_given = true;
  double model_ratio = 1;  // of the given energies to those of the robot file
};

// Faults of a table of runs, found before any effect is estimated: energies in another unit, or constant over
// all runs, which contradicts all of them; a payload that the robot file does not permit; single runs that
// are far from the prediction of all others.
struct RunChecks {
  std::vector<Check> checks;
  std::vector<std::size_t> apart;  // runs that are far from the others
};
RunChecks check_runs(const RunRows& rows, const robot::RobotModel& robot);

}  // namespace joulecast::gap
