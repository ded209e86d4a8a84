#pragma once

#include <string>
#include <vector>

#include "gap/posterior/bagging.h"
#include "gap/posterior/hold_out.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap::posterior {

// An effect or covariate that explains the gap. Its probability is bagged, times constancy, capped by the
// gates.
struct ExplainedBy : DiagnosedEffect {
  std::size_t hypothesis = 0;  // of its likeliest model
  double bagged = 0, constant = 1;
  bool at_bound = false;   // its strength is at an end of its range: no estimate
  double power_share = 0;  // mean |change of power| over mean power
};

// The answer of the posterior.
struct Explained {
  Verdict verdict = Verdict::inconclusive;
  double probability = 0;  // of the verdict
  double none = 0;         // probability that neither an effect nor a function is present
  std::vector<ExplainedBy> effects;
  std::vector<Term> terms;  // largest first; empty without battery power
  std::vector<TermSum> sums;
  Outside outside;
  double outside_share = 0;
  HeldOut held_out;
  double noise = 0;       // of one row of power, over mean power
  double detectable = 0;  // smallest share of power at which nine of ten effects show
  double repeats_file = 0, repeats_left = 0;
  std::array<double, factor_count> factors{};  // posterior of the factor on the tolerances of the file
  std::vector<std::string> reasons;            // of gates that changed the answer
  std::vector<dynamics::ActiveEffect> model;   // effects and calibration that predict best, beyond the file's
  Eigen::VectorXd explained_w;  // by row of power, by the model and the causes that follow covariates
  bool adopts = false;          // the model reduces the held-out error
};

// The answer at the point that the walk reached, with the effects that other witnesses name.
Explained explain(const Fit& fit);

}  // namespace joulecast::gap::posterior
