#pragma once

#include <nlohmann/json_fwd.hpp>

#include "gap/groups/compare.h"

namespace joulecast::gap {

// Returns the JSON that `joulecast gap --compare-by --json` prints: a diagnosis's JSON of the differences,
// `kind` "comparison", and the fields of groups.
nlohmann::ordered_json comparison_to_json(const Comparison& comparison);

}  // namespace joulecast::gap
