#pragma once

#include <string>
#include <vector>

#include "gap/diagnosis.h"

namespace joulecast::gap {

// Where something outside the catalogue shows and what it follows, where that stands out.
std::string outside_words(const Outside& outside);

// Why a verdict is not "effects" or "none", a sentence each: where and by what something outside the
// catalogue shows, or what speaks against the effects that are likeliest. Empty for the other verdicts.
std::vector<std::string> verdict_reasons(const Diagnosis& diagnosis);

}  // namespace joulecast::gap
