#pragma once

#include <vector>

#include "gap/posterior/data.h"
#include "gap/runs/run_table.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// A table of runs as rows of the posterior: the energy of a run over its duration, relative to its energy.
class RunRows {
 public:
  RunRows(const RunSet& set, const robot::RobotModel& robot, std::vector<dynamics::ActiveEffect> in_file);

  const std::vector<MissionRun>& runs() const { return runs_; }
  const posterior::Data& data() const { return data_; }
  bool by_motor() const { return by_motor_; }  // all runs were measured motor by motor
  bool model_given() const { return model_given_; }
  double model_ratio() const { return model_ratio_; }  // of the given energies to those of the robot file

  double duration_s(std::size_t run) const { return duration_s_[run]; }

  // Energy of each run for these powers of the rows [J]; where a run has energies of a model, they change
  // those.
  std::vector<double> energies_j(const Eigen::VectorXd& power_w) const;
  // Of each row of the data: J for one of its watts, and energy that is not in its power.
  const std::vector<double>& joules() const { return joule_; }
  const std::vector<double>& offsets_j() const { return offset_j_; }
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
  void silence(const std::vector<std::size_t>& runs);

 private:
  std::vector<MissionRun> runs_;
  posterior::Data data_;
  // Of each run: J for one W of its row, the given model minus the robot file's, the reference of relative
  // errors.
  std::vector<double> joule_, offset_j_, size_j_, duration_s_;
  bool by_motor_ = true, model_given_ = true;
  double model_ratio_ = 1;
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
