#pragma once

#include <array>

namespace joulecast::gap {

// How the answer that names an effect stands.
enum class Standing {
  alone,         // nothing speaks against it, and nothing else would do in its place
  grouped,       // the same, with others that the data cannot tell from it
  inconclusive,  // something speaks against the answer as a whole
  outside        // named beside something that the catalogue does not know
};

// Names with a posterior near `posterior` in trials: how many there were, and how many of them were right.
struct ProbabilityBin {
  Standing standing;
  double posterior;    // mean of the bin
  double probability;  // of being right, falling nowhere with the posterior
  int named, right;
};

#include "gap/verdict/probabilities.inc"

// The probability to state for an effect so named: how often such names came true in trials, interpolated between the
// bins of the table.
double stated_probability(double posterior, Standing standing);

inline constexpr double surest_verdict = 0.97;  // what verdicts of posterior 1 came true in trials

}  // namespace joulecast::gap
