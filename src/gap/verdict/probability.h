#pragma once

#include <array>

#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Names with a posterior near `posterior` in trials: how many there were, and how many of them were right.
struct ProbabilityBin {
  Standing standing;
  double posterior;    // mean of the bin
  double probability;  // of being right, falling nowhere with the posterior
  int named, right;
};

// probability_table, and surest_verdict: how often verdicts of the highest probability came true.
#include "gap/verdict/probabilities.inc"

// The probability to state for an effect so named: how often such names came true in trials, interpolated
// between the bins of the table.
double stated_probability(double posterior, Standing standing);

}  // namespace joulecast::gap
