#pragma once

#include "gap/posterior/explain_recordings.h"
#include "gap/verdict/diagnosis.h"

// The answer of the posterior as a diagnosis, for recordings, tables of runs and groups.
namespace joulecast::gap {

// Sets verdict, effects and outside. All listed effects are reported, for Verdict::effects only the named
// ones, for Verdict::none none. `mean_power_w` is NaN where no power is known.
void state_effects(const posterior::Explained& answer, double mean_power_w, Diagnosis& diagnosis);

// Sets the errors of the baseline, their deviation over blocks and, where effects are reported, the
// shrinkage. Does nothing where no power was held out.
void state_held_out(const posterior::HeldOut& held_out, Diagnosis& diagnosis);

// Multiplies probabilities by sound_readings(). Below one half the verdict is inconclusive.
void weigh_by_checks(Diagnosis& diagnosis);

// Origin of the power of these recordings.
PowerSource power_source(const posterior::Data& data);

// Sets the effects that a robot file may take, one shape of each, and the reason against adopting them.
// `other_channels`: the fit has other channels than power.
void state_offer(const posterior::Fit& fit, const posterior::Explained& answer, bool other_channels,
                 Diagnosis& diagnosis);

}  // namespace joulecast::gap
