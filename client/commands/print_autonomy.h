#pragma once

#include <nlohmann/json_fwd.hpp>

namespace joulecast::client {

// An autonomy answer, of one robot or of a fleet, as tables for people. An answer in another dialect is
// printed as received.
void print_autonomy(const nlohmann::json& answer);

}  // namespace joulecast::client
