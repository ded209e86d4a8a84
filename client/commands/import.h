#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/error.h"
#include "telemetry/csv_import.h"

namespace joulecast::client {

// A mapping file; errors name the file and, behind a '#', the member.
[[nodiscard]] Result<telemetry::ImportMapping> read_mapping(const std::string& path);

// The first mistake in a mapping file of bags; unavailable without Node.js.
[[nodiscard]] Result<void> check_bag_mapping(const std::string& path);

// The missions of a table with the tables that the mapping joins to it, at the paths given in the mapping.
[[nodiscard]] Result<std::vector<telemetry::Import>> import_table(const std::string& path,
                                                                  const telemetry::ImportMapping& mapping,
                                                                  telemetry::ImportOptions how);

// Numbers the samples of a robot's next mission on from `next`, which has a number for each robot.
void number_on(telemetry::Recording& recording, std::map<std::string, std::int64_t>& next);

}  // namespace joulecast::client
