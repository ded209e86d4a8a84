#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "gap/diagnosis.h"

namespace joulecast::gap {

// The contract of `joulecast gap --json`. Unknown numbers are null. `model_version` names the robot file's
// version, null outside a server.
nlohmann::json diagnosis_to_json(const Diagnosis& diagnosis);
std::string to_json_text(const Diagnosis& diagnosis, int indent = 2);

}  // namespace joulecast::gap
