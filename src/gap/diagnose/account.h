#pragma once

#include "gap/diagnose/held_out.h"
#include "gap/diagnose/referee.h"
#include "gap/verdict/diagnosis.h"

// What an answer says of held-out parts, alike for recordings, runs and groups.
namespace joulecast::gap {

// The errors of regression, unchanged model and explanation, with functions outside the catalogue or without;
// its terms are to be added.
Baseline baseline_of(const HeldOut& held_out, bool with_functions = false);

// One term as the regression has it (`data`, with its deviation) beside what the model comes to in the same
// term; in words too where the two surely and notably differ.
void add_term(Baseline& baseline, const RefereeTerm& term, double data, double deviation, double model);

// How far the gap shrinks, and in how many parts the same is named as in all data.
Shrinkage shrinkage_of(const HeldOut& held_out, const std::vector<Hypothesis>& hypotheses,
                       const HypothesisSet& named, double noise_floor);

}  // namespace joulecast::gap
