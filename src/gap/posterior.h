#pragma once

#include <map>
#include <string_view>
#include <vector>

#include "gap/fit.h"

namespace joulecast::gap {

// Whether an effect has to show in battery power to be worth a name. The others are seen by other channels
// (gyro, map, battery voltage, the shape of transients) however little power they move.
bool shows_in_power(std::string_view id);

// Explanations with what does not matter taken out, and the odds of those that become the same added up.
struct Posterior {
  std::map<std::vector<std::size_t>, double> sets;  // probability
  double none = 0, outside = 0;
  bool by_gap_alone = false;  // the evidence says nothing is there, but a gap stands that noise does not make

  double of_effect(const ColumnSet& columns, const dynamics::Effect* effect) const;
};

// Of the mean power, beyond the noise floor: what may be left over while nothing is named. Robots as filed
// left at most 0.008 in development trials.
inline constexpr double largest_unnamed_share = 0.012;

// Share of the mean power that something outside the catalogue has to move to be a finding, when the data
// prefer it by these log odds.
double least_outside_of(double gap_share, double log_odds);

// `power_gap`: the gap beside battery power, NaN where power is not measured; `gap_share`: the same with
// noise taken off.
Posterior posterior_of(const Fit& fit, const MovedShares& moved, double gap_share, double power_gap);

}  // namespace joulecast::gap
