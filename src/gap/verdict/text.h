#pragma once

#include <string>
#include <vector>

#include "gap/verdict/diagnosis.h"

// What a diagnosis says in sentences, for the report, the page and the command line alike.
namespace joulecast::gap {

// Where something outside the catalogue shows, what it follows and how large it is, where that stands out.
std::string outside_words(const Outside& outside);

// What the missions before a step between missions say, beside an answer from `first_mission` on.
std::string earlier_words(const Diagnosis& earlier, std::string_view first_mission);

// Why a verdict is not more than it is: what speaks against the effects that are likeliest, where and by what
// something outside the catalogue shows, what the plain regression says better. Empty where nothing does.
std::vector<std::string> reasons_for(const Diagnosis& diagnosis, bool worse_than_regression);

// The refusal of an effect that its alternatives leave open; empty: none is open.
std::string refusal_by_alternatives(const Diagnosis& diagnosis);

}  // namespace joulecast::gap
