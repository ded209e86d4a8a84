#pragma once

#include <span>
#include <string>
#include <vector>

#include "gap/verdict/diagnosis.h"

// Sentences of a diagnosis, for the report, the page and the command line alike.
namespace joulecast::gap {

// The probability that readings have no error as a diagnosis takes them: corrected, or as they are where the
// checks hold an error for likely; and that of an error, in words.
double sound_readings(std::span<const Check> checks);
std::string error_words(double sound);

// The probability of a cause outside the catalogue, where it is visible, the variable it follows and its
// size, where that is significant.
std::string outside_words(const Outside& outside);

// The result of the missions before a step between missions, to accompany a diagnosis from `first_mission`
// on.
std::string earlier_words(const Diagnosis& earlier, std::string_view first_mission);

// Reasons that limit a verdict: contradicting evidence on the likeliest effects, the channel and the variable
// of a cause outside the catalogue, terms in which the linear regression is better. Empty where there are no
// reasons.
std::vector<std::string> reasons_for(const Diagnosis& diagnosis, bool worse_than_regression);

// What recordings lack that cannot be diagnosed. `motion_known`: the wheels' motion is, for long enough.
std::string missing_data(const Diagnosis& diagnosis, bool motion_known);

}  // namespace joulecast::gap
