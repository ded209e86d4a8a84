#pragma once

#include <vector>

#include "gap/diagnose/referee.h"
#include "gap/runs/run_columns.h"
#include "statistics/regression.h"

namespace joulecast::gap {

// A plain, robust regression of energy on distance, time, what was carried, turned and climbed, and the
// covariates over time, as far as they differ: the referee of a diagnosis of runs.
class RunReferee {
 public:
  explicit RunReferee(const RunColumns& columns);

  const std::vector<RefereeTerm>& terms() const { return terms_; }

  // Energies of all runs by the terms, fitted to the runs that are not left out, errors relative to
  // RunColumns::size_j.
  struct Fit {
    statistics::Regression regression;
    std::vector<double> energy_j;
  };
  Fit fit(const std::vector<double>& energy_j, const std::vector<bool>& left_out = {}) const;

  // Of each run, how far its energy is from the fit of those that are not left out, over their spread. Beyond
  // `gross` it is no run like the others.
  static constexpr double gross = 6;
  std::vector<double> apart(const std::vector<double>& energy_j,
                            const std::vector<bool>& left_out = {}) const;

 private:
  std::vector<RefereeTerm> terms_;
  Eigen::MatrixXd x_;  // runs by terms
  std::vector<double> size_;
};

}  // namespace joulecast::gap
