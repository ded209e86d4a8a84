#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "telemetry/csv_import.h"

namespace joulecast::client {

// Whether a path is a recording of ROS: a folder, or by its suffix or first bytes a ROS 1 bag, MCAP or a
// ROS 2 bag in SQLite.
[[nodiscard]] bool is_bag(const std::string& path);

// Bags to convert, and the files of --mapping and --robot and the id of --robot-id, empty where not given.
struct BagRequest {
  std::vector<std::string> bags;
  std::string mapping, robot, robot_id;
};

// A table with its mapping.
struct ImportSource {
  std::string shown;               // the table's file, or the first bag of the recording
  std::string table, mapping;      // files
  std::vector<std::string> lines;  // of a bag: each topic found and its use, missing sources, warnings
};

// Recordings of bags as tables, in a folder that is removed with the object.
struct BagTables {
  std::shared_ptr<const std::string> folder;
  std::vector<ImportSource> recordings;
};

// Runs deploy/import/bags.cjs by node. Errors: invalid for bags that cannot be used, unavailable where node
// or the converter is missing or fails.
[[nodiscard]] Result<BagTables> convert_bags(const BagRequest& request);

// A mapping file; errors name the file and, behind a '#', the member.
[[nodiscard]] Result<telemetry::ImportMapping> read_mapping(const std::string& path);

// The missions of a table with the tables that the mapping joins to it, at the paths given in the mapping.
[[nodiscard]] Result<std::vector<telemetry::Import>> import_table(const std::string& path,
                                                                  const telemetry::ImportMapping& mapping,
                                                                  telemetry::ImportOptions how);

// Numbers the samples of a robot's recordings on, in their order; `next` by robot.
void number_on(telemetry::Recording& recording, std::map<std::string, std::int64_t>& next);

}  // namespace joulecast::client
