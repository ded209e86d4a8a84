#pragma once

#include <string>
#include <vector>

#include "base/error.h"
#include "telemetry/csv_import.h"

namespace joulecast::client {

// A mapping file; errors name the file and, behind a '#', the member.
[[nodiscard]] Result<telemetry::ImportMapping> read_mapping(const std::string& path);

// The missions of a table with the tables that the mapping joins to it, at the paths given in the mapping.
[[nodiscard]] Result<std::vector<telemetry::Import>> import_table(const std::string& path,
                                                                  const telemetry::ImportMapping& mapping,
                                                                  telemetry::ImportOptions how);

}  // namespace joulecast::client
