#pragma once

#include <nlohmann/json_fwd.hpp>

#include "gap/groups/compare.h"

namespace joulecast::gap {

// What `joulecast gap --compare-by --json` prints: a diagnosis's JSON of the differences, `kind`
// "comparison", and what only groups have.
nlohmann::ordered_json comparison_to_json(const Comparison& comparison);

}  // namespace joulecast::gap
