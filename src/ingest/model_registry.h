#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "answers/model.h"
#include "base/error.h"
#include "history/store.h"
#include "history/writer.h"
#include "ingest/by_robot.h"

namespace joulecast::ingest {

using answers::model_in_force;
using answers::ModelInForce;

// The error of every answer about a robot id that does not exist.
Error unknown_robot(std::string field, std::string_view robot_id);

class ModelRegistry : ByRobot<ModelInForce> {
 public:
  using ByRobot::all, ByRobot::find, ByRobot::Pointer, ByRobot::size;

  // Puts a robot's model in force; an effect that the catalogue rejects is an error and changes nothing.
  Result<void> put(robot::RobotModel robot, std::int64_t version);
  // Puts one in force that was before.
  void put_back(Pointer model);
  // Takes it out of force.
  void remove(std::string_view robot_id);

  // Increases with every change, so that users can detect one.
  std::uint64_t epoch() const { return epoch_; }

 private:
  std::atomic<std::uint64_t> epoch_ = 0;
};

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
