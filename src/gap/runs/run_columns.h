#pragma once

#include <Eigen/Dense>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "gap/equations/hypothesis.h"
#include "gap/runs/run_table.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// One equation: measured - modelled energy [J] = x . coefficients + scatter. Trends and shifts of tables are
// relative to the run's energy, the other regressors in J.
struct RunRow {
  std::size_t run = 0;
  bool difference = false;  // right minus left motor; otherwise their sum, or the battery
  Eigen::VectorXd x;
  double y = 0;
};

// What every hypothesis does to the energies of runs: effects of the catalogue, covariates and labels that a
// load or a friction follows, trends over the conditions for what the catalogue does not know; and what is
// never a finding, a common scale of model and meter and a shift of each table.
class RunColumns {
 public:
  // `adopted`: the effects of the robot file.
  RunColumns(const RunSet& set, const robot::RobotModel& robot, std::vector<dynamics::ActiveEffect> adopted);

  // Differentiates around these from now on; at first around none. `only`: just the columns of these
  // hypotheses, the others' become zero; empty: all. Sets are compared around none, since effects that act
  // through others (payload errors through rolling resistance, say) would otherwise be taken for them.
  void linearise_around(std::span<const Cause> causes, const HypothesisSet& only = {});

  const std::vector<MissionRun>& runs() const { return set_.runs; }
  const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  const std::vector<Column>& columns() const { return columns_; }
  std::size_t size() const { return columns_.size(); }
  const std::vector<RunRow>& rows() const { return rows_; }
  bool relative(std::size_t column) const { return column >= first_relative_; }
  // Columns of shifts of the tables; as many as there are tables, where there are several.
  std::size_t first_shift() const { return first_shift_; }
  // Covariates from zero, where runs were near it, so that a constant load beside them is what is left
  // without them; otherwise, and labels (as "surface=ice", 1 or 0) always, by how far each run is from the
  // median. Where one is not given the median stands.
  const std::vector<std::string>& covariates() const { return covariate_names_; }
  double covariate(std::size_t run, std::size_t index) const { return covariates_[run][index]; }

  // What errors of a run are relative to [J]: its energy, or where that is far off, what the model and the
  // other runs let expect, so that a wrong value, a small one above all, weighs no more than others.
  double size_j(std::size_t run) const { return size_j_[run]; }

  bool by_motor() const { return by_motor_; }
  bool model_given() const { return model_given_; }
  double model_ratio() const { return model_ratio_; }
  // Ids of the effects that move none of these energies noticeably within their bounds.
  const std::vector<std::string>& not_visible() const { return not_visible_; }

  std::vector<Cause> causes_of(const HypothesisSet& set, const Eigen::VectorXd& coefficients) const;

  struct Energy {
    double sum_j = 0;         // both motors, or the battery
    double difference_j = 0;  // right minus left
    double duration_s = 0;
  };
  // By the model given with the run, or by the robot file, with these causes in force.
  Energy modelled(std::size_t run, std::span<const Cause> causes) const;
  // How far an energy is from the measured one, over that or size_j, whichever is larger.
  double missed(std::size_t run, double energy_j) const;
  // Its mean over these runs (all, where empty).
  double error(std::span<const Cause> causes, const std::vector<bool>& left_out = {}) const;

 private:
  Energy by_robot(std::size_t run, std::span<const dynamics::ActiveEffect> effects) const;
  std::vector<dynamics::ActiveEffect> in_run(std::size_t run, std::span<const Cause> causes) const;
  void set_sizes();
  void add_labels();
  void add_effects();
  void add_covariates();
  void add_trends();
  void add_shifts();
  void differentiate(std::size_t column, std::span<const Cause> causes);

  RunSet set_;
  robot::RobotModel robot_;
  std::vector<dynamics::ActiveEffect> adopted_;
  std::map<std::string, std::size_t> tables_;
  std::vector<std::string> covariate_names_;
  std::vector<std::vector<double>> covariates_;  // by run
  std::vector<Hypothesis> hypotheses_;
  std::vector<Column> columns_;
  std::vector<Cause> column_cause_;  // of columns of effects and covariates, strength zero
  std::size_t first_relative_ = 0, first_shift_ = 0;
  std::vector<std::string> not_visible_;
  std::vector<Energy> plain_;  // by the robot file, of each run
  std::vector<double> size_j_;
  std::vector<RunRow> rows_;
  bool by_motor_ = true, model_given_ = true;
  double model_ratio_ = 1;
};

}  // namespace joulecast::gap
