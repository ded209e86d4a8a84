#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/error.h"

namespace joulecast::client {

// Whether a path is a recording of ROS: a folder, or by its suffix or first bytes a ROS 1 bag, MCAP or a
// ROS 2 bag in SQLite.
[[nodiscard]] bool is_bag(const std::string& path);

// Bags to convert, and the files of --mapping and --robot and the id of --robot-id, empty where not given.
struct BagRequest {
  std::vector<std::string> bags;
  std::string mapping, robot, robot_id;
};

// A recording of one or more bags as a table with its mapping.
struct BagTable {
  std::string source;              // the first bag
  std::string table, mapping;      // files
  std::vector<std::string> lines;  // each topic found and its use, missing sources, warnings
};

// The tables of bags, in a temporary folder that is removed with the object.
class BagTables {
 public:
  // Runs deploy/import/bags.cjs by node. Errors: invalid for bags that cannot be used, unavailable where node
  // or the converter is missing or fails.
  static Result<BagTables> convert(const BagRequest& request);
  BagTables(BagTables&& other) noexcept;
  BagTables& operator=(BagTables&&) = delete;
  ~BagTables();

  [[nodiscard]] const std::vector<BagTable>& recordings() const noexcept { return recordings_; }

 private:
  explicit BagTables(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path folder_;
  std::vector<BagTable> recordings_;
};

}  // namespace joulecast::client
