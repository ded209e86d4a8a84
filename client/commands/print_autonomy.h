#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace joulecast::client {

// An autonomy answer, of one robot or of a fleet, as tables for people. An answer in another dialect is
// printed as received. `unit` is that of energies (print.h).
void print_autonomy(const nlohmann::json& answer, const std::string& unit);

}  // namespace joulecast::client
