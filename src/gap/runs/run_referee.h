#pragma once

#include <string>
#include <vector>

#include "gap/runs/run_columns.h"
#include "statistics/regression.h"

namespace joulecast::gap {

// A plain, robust regression of energy on distance, time, what was carried, turned and climbed, and the
// covariates over time, as far as they differ: the referee of a diagnosis of runs.
class RunReferee {
 public:
  explicit RunReferee(const RunColumns& columns);

  struct Term {
    std::string name, unit, words;  // "so many <words>"
  };
  const std::vector<Term>& terms() const { return terms_; }

  // Energies of all runs by the terms, fitted to the runs that are not left out, errors relative to the
  // measured ones.
  struct Fit {
    statistics::Regression regression;
    std::vector<double> energy_j;
  };
  Fit fit(const std::vector<double>& energy_j, const std::vector<bool>& left_out = {}) const;

 private:
  std::vector<Term> terms_;
  Eigen::MatrixXd x_;         // runs by terms
  std::vector<double> size_;  // measured energies
};

}  // namespace joulecast::gap
