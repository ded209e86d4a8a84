#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "gap/search.h"

namespace joulecast::gap {

// How much of the data to believe when an explanation has these log odds: formulas err as well as readings.
double coarsening_for(double log_odds);

// One linearisation of everything and what it says.
struct Fit {
  std::unique_ptr<ColumnSet> columns;
  Design design;
  std::vector<Information> missions;
  Information total;
  std::unique_ptr<Evidence> evidence;
  std::vector<Explanation> explanations;  // best first
};

struct FitResult {
  Fit fit;
  Shapes shapes;
  std::vector<Chosen> chosen;  // the effects that `fit` is linearised around
};

// Where the battery is only judged from motion: too few windows carry motor currents.
bool without_motor_channels(std::span<const Window> windows);

// Searches, then linearises around the effects found, narrows their shapes and searches again until the set
// stands. Cancelled (empty) when `goes_on` returns false.
std::optional<FitResult> fit_windows(const robot::RobotModel& robot, std::span<const Window> windows,
                                     double gap_share, const std::function<bool(double)>& goes_on,
                                     const MethodParts& parts = {});

// How much of the mean battery power hypotheses move (of the range of their own variable for kinematic
// outside families), by estimated coefficients.
class MovedShares {
 public:
  MovedShares(const Fit& fit, std::span<const Window> windows);
  double operator()(const Hypothesis& hypothesis, const Eigen::VectorXd& coefficients) const;

 private:
  const ColumnSet& columns_;
  std::vector<Eigen::MatrixXd> values_;  // by hypothesis: sampled equations by its columns; empty for effects
  std::vector<std::size_t> samples_;     // windows that the equations of each come from
};

}  // namespace joulecast::gap
