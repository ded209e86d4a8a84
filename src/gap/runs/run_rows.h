#pragma once

#include <vector>

#include "gap/posterior/data.h"
#include "gap/runs/run_table.h"

namespace joulecast::gap {

// A table of runs as rows of the posterior: the energy of a run over its duration, so that a posterior of
// runs is one of recordings with long rows. Rows are relative to the energy of their run.
class RunRows {
 public:
  RunRows(const RunSet& set, const robot::RobotModel& robot, std::vector<dynamics::ActiveEffect> in_file);

  const std::vector<MissionRun>& runs() const { return runs_; }
  const posterior::Data& data() const { return data_; }
  bool by_motor() const { return by_motor_; }  // all runs were measured motor by motor
  bool model_given() const { return model_given_; }
  double model_ratio() const { return model_ratio_; }  // of the given energies to those of the robot file

  double duration_s(std::size_t run) const { return duration_s_[run]; }

  // Of each run what these powers of the rows come to [J], by the model in question: where a run has energies
  // of a model, powers change those.
  std::vector<double> energies_j(const Eigen::VectorXd& power_w) const;
  // Of each row of the data: J for one of its watts, and energy that is not in its power.
  const std::vector<double>& joules() const { return joule_; }
  const std::vector<double>& offsets_j() const { return offset_j_; }
  // By the model as it is.
  std::vector<double> modelled_j() const;
  // How far an energy is from the measured one, over that or what the model and the other runs let expect,
  // whichever is larger: a wrong value, a small one above all, weighs no more than others.
  double missed(std::size_t run, double energy_j) const;
  // Energies of all runs by a plain regression, and how far each run is from it over their spread.
  struct Regression {
    std::vector<double> energy_j, apart;
  };
  Regression regression() const;
  // From now on these runs have next to no say.
  void silence(const std::vector<std::size_t>& runs);

 private:
  std::vector<MissionRun> runs_;
  posterior::Data data_;
  // Of each run: J for one W of its row, the given model above the robot file's, what errors are relative to.
  std::vector<double> joule_, offset_j_, size_j_, duration_s_;
  bool by_motor_ = true, model_given_ = true;
  double model_ratio_ = 1;
};

}  // namespace joulecast::gap
