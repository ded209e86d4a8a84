#pragma once

#include <vector>

#include "gap/posterior/explain_recordings.h"

namespace joulecast::gap {

// Errors of one held-out row of data, relative to the measured value.
struct LeftOutErrors {
  double unchanged = 0, explained = 0, regression = 0;
};

// Sets verdict, effects, outside and reasons. `power_w`: mean power.
void state_effects(const posterior::Explained& answer, double power_w, Diagnosis& diagnosis);

// Sets the effects that may be adopted, and the reason against adopting them.
void state_offer(const posterior::Fit& fit, const posterior::Explained& answer, Diagnosis& diagnosis);

// Sets the baseline with its terms, and where effects were named the shrinkage. `errors`: of each row when it
// was held out.
void state_held_out(const posterior::Fit& fit, const std::vector<LeftOutErrors>& errors, std::size_t parts,
                    Diagnosis& diagnosis);

}  // namespace joulecast::gap
