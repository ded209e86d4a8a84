#pragma once

#include <nlohmann/json_fwd.hpp>

#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Returns the JSON that `joulecast gap --json` prints and a server stores: schemas/gap.schema.json. Unknown
// numbers are null. `model_version` is the robot file's version, null outside a server.
nlohmann::ordered_json diagnosis_to_json(const Diagnosis& diagnosis);
// Returns the member `figures` of that: the data of the charts, by columns.
nlohmann::ordered_json figures_to_json(const Figures& figures);

}  // namespace joulecast::gap
