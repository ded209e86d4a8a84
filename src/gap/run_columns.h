#pragma once

#include <array>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "gap/mission_runs.h"
#include "gap/run_evidence.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// What every effect of the catalogue does to the energies of runs, beside trends over their conditions.
class RunColumns {
 public:
  RunColumns(std::span<const MissionRun> runs, const robot::RobotModel& robot);

  // Differentiates around these effects from now on; at first around none. `only`: just the columns of these
  // candidates, the others' become zero; empty: all. Sets are compared around no effect, since effects that
  // act through others (payload errors through rolling resistance, say) would otherwise be taken for them.
  void linearise_around(std::span<const dynamics::ActiveEffect> effects,
                        std::span<const std::size_t> only = {});

  std::span<const MissionRun> runs() const { return runs_; }
  std::span<const RunCandidate> candidates() const { return candidates_; }
  std::size_t size() const { return column_size_.size(); }
  std::size_t tables() const { return tables_.size(); }
  bool by_motor() const { return by_motor_; }
  bool model_given() const { return model_given_; }
  double model_ratio() const { return model_ratio_; }
  // Ids of the effects that move none of these energies noticeably within their bounds.
  const std::vector<std::string>& not_visible() const { return not_visible_; }

  // Mean |change of the relative energy| for a coefficient of one.
  double size_of(std::size_t column) const { return column_size_[column]; }

  std::vector<RunEquation> equations(std::size_t run) const;

  // Effects of a set with its coefficients, in the order of its candidates; trends are left out.
  std::vector<dynamics::ActiveEffect> effects_of(std::span<const std::size_t> set,
                                                 const Eigen::VectorXd& coefficients) const;

  struct Energy {
    double sum_j = 0;         // both motors, or the battery
    double difference_j = 0;  // right minus left
  };
  // By the model given with the run, or by the robot file, with these effects added.
  Energy modelled(std::size_t run, std::span<const dynamics::ActiveEffect> effects) const;

  // How much each effect, on average over the orders of adding them, takes off the mean absolute relative
  // error, over that error without any.
  std::vector<double> effect_shares(std::span<const dynamics::ActiveEffect> effects) const;

 private:
  Energy by_robot(std::size_t run, std::span<const dynamics::ActiveEffect> effects) const;
  void add_effects();
  void add_trends();

  std::vector<MissionRun> runs_;
  robot::RobotModel robot_;
  std::vector<dynamics::ActiveEffect> adopted_;
  std::map<std::string, std::size_t> tables_;
  std::vector<RunCandidate> candidates_;
  std::vector<double> column_size_;
  std::vector<std::string> not_visible_;
  std::vector<Energy> plain_;                      // by the robot file, of each run
  std::vector<Eigen::VectorXd> sum_, difference_;  // columns and response of each run, relative
  bool by_motor_ = true, model_given_ = false;
  double model_ratio_ = 1;
};

}  // namespace joulecast::gap
