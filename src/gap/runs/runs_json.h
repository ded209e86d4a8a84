#pragma once

#include <nlohmann/json_fwd.hpp>

#include "gap/runs/diagnose_runs.h"

namespace joulecast::gap {

// Returns the JSON that `joulecast gap --missions --json` prints: a diagnosis's JSON, `kind`
// "mission_energies", and the fields of runs.
nlohmann::ordered_json runs_to_json(const RunDiagnosis& diagnosis);

}  // namespace joulecast::gap
