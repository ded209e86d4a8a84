#pragma once

#include <nlohmann/json_fwd.hpp>

#include "gap/runs/diagnose_runs.h"

namespace joulecast::gap {

// What `joulecast gap --missions --json` prints: a diagnosis's JSON, `kind` "mission_energies", and what only
// runs have.
nlohmann::ordered_json runs_to_json(const RunDiagnosis& diagnosis);

}  // namespace joulecast::gap
