#pragma once

#include <nlohmann/json_fwd.hpp>

#include "describe/table.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Returns the JSON that `joulecast gap --json` prints and a server stores. Unknown numbers are null.
// `model_version` is the robot file's version, null outside a server.
nlohmann::ordered_json diagnosis_to_json(const Diagnosis& diagnosis);
const described::Table<Diagnosis>& diagnosis_table();
// The member `figures` of that: the data of the charts, by columns.
const described::Table<Figures>& figures_table();
// Its schema "gap", and those that it refers to.
described::Schemas diagnosis_schemas();

}  // namespace joulecast::gap
