#pragma once

#include <nlohmann/json_fwd.hpp>

#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// What `joulecast gap --json` prints and a server stores: schemas/gap.schema.json. Numbers that are not known are null.
// `model_version` is the robot file's version, null outside a server.
nlohmann::ordered_json diagnosis_to_json(const Diagnosis& diagnosis);

}  // namespace joulecast::gap
