#pragma once

#include <vector>

#include "gap/posterior/explain_recordings.h"

namespace joulecast::gap {

// Sets verdict, effects, outside and reasons. `power_w`: mean power.
void state_effects(const posterior::Explained& answer, double power_w, Diagnosis& diagnosis);

// Sets the effects that may be adopted, and the reason against adopting them.
void state_offer(const posterior::Fit& fit, const posterior::Explained& answer, Diagnosis& diagnosis);

// Sets the errors of the baseline, and where effects were named the shrinkage. `errors`: of each row or block
// when it was held out, of size 1 and relative to the measured value.
void state_held_out(const std::vector<posterior::HeldOut::Block>& errors, std::size_t parts,
                    Diagnosis& diagnosis);

// Adds the terms of the plain regression to the baseline.
void state_terms(const posterior::Fit& fit, Baseline& baseline);

}  // namespace joulecast::gap
