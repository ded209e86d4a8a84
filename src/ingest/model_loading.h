#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/store.h"
#include "history/writer.h"
#include "ingest/model_registry.h"

namespace joulecast::ingest {

Result<std::shared_ptr<const ModelInForce>> stored_model(const history::Store& store,
                                                         const std::string& robot_id, std::int64_t version);

// Puts the store's active models in force. A model that no longer reads is an error with robot and version.
Result<void> load_stored_models(const history::Store& store, ModelRegistry& models);

// A robot file with effects of the catalogue; errors name the file.
Result<robot::RobotModel> read_robot_file(const std::string& path);

// Adds the robot file's model as a new version if it differs from the last version that came from a file; a
// model adopted since then stays in force.
Result<void> load_robot(const robot::RobotModel& robot, const std::string& path, history::Store& store,
                        history::Writer& writer, std::int64_t now_utime_us);

// The robot files (*.json) of a directory.
struct RobotFiles {
  std::vector<std::pair<std::string, robot::RobotModel>> robots;  // with their paths
  std::vector<Error> faulty;                                      // one a file that cannot be used
};

// Fault::not_found when the directory cannot be read.
Result<RobotFiles> read_robot_files(const std::string& directory);

}  // namespace joulecast::ingest
