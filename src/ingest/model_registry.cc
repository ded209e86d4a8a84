#include "ingest/model_registry.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "base/try.h"
#include "robot/robot_file.h"

namespace joulecast::ingest {

Error unknown_robot(std::string field, std::string_view robot_id) {
  return {Fault::not_found, std::move(field), "no robot is called '" + std::string(robot_id) + "'"};
}

Result<void> ModelRegistry::put(robot::RobotModel robot, std::int64_t version) {
  TRY_ASSIGN(std::shared_ptr<const ModelInForce> model, model_in_force(std::move(robot), version));
  put_back(std::move(model));
  return {};
}

void ModelRegistry::put_back(Pointer model) {
  const std::string& id = model->robot.robot_id;
  ByRobot::put(id, std::move(model));
  ++epoch_;
}

void ModelRegistry::remove(std::string_view robot_id) {
  ByRobot::remove(robot_id);
  ++epoch_;
}

Result<std::shared_ptr<const ModelInForce>> stored_model(const history::Store& store,
                                                         const std::string& robot_id, std::int64_t version) {
  TRY_ASSIGN(const history::ModelVersion stored, store.model(robot_id, version));
  TRY_ASSIGN(robot::RobotModel robot, robot::parse_robot(stored.model_json));
  return model_in_force(std::move(robot), version);
}

Result<void> load_stored_models(const history::Store& store, ModelRegistry& models) {
  TRY_ASSIGN(std::vector<history::RobotRecord> robots, store.robots());
  for (const history::RobotRecord& record : robots) {
    if (!record.active_version) continue;
    TRY_ASSIGN(history::ModelVersion version, store.model(record.robot_id));
    const auto named = [&](Error error) {
      error.message = "stored model of " + record.robot_id + ", version " + std::to_string(version.version) +
                      ": " + error.message;
      return tl::unexpected(std::move(error));
    };
    Result<robot::RobotModel> robot = robot::parse_robot(version.model_json);
    if (!robot) return named(std::move(robot.error()));
    if (Result<void> placed = models.put(std::move(*robot), version.version); !placed)
      return named(std::move(placed.error()));
  }
  return {};
}

Result<robot::RobotModel> read_robot_file(const std::string& path) {
  Result<robot::RobotModel> robot = robot::load_robot(path);
  if (!robot) return robot;
  if (auto effects = dynamics::active_effects(*robot); !effects)
    return fail(effects.error().fault, std::move(effects.error().field),
                path + ": " + effects.error().message);
  return robot;
}

Result<void> load_robot(const robot::RobotModel& robot, const std::string& path, history::Store& store,
                        history::Writer& writer, std::int64_t now_utime_us) {
  history::AddModel command;
  command.robot_id = robot.robot_id;
  command.utime_us = now_utime_us;
  command.origin = history::ModelOrigin::file;
  command.note = std::filesystem::path(path).filename().string();
  command.model_json = robot::to_json_text(robot);
  if (const auto versions = store.model_versions(robot.robot_id)) {
    const auto last = std::ranges::find(*versions, history::ModelOrigin::file,
                                        &history::ModelVersion::origin);  // newest first
    if (last != versions->end() && last->model_json == command.model_json) return {};
  }
  TRY(writer.execute(std::move(command)));
  return {};
}

Result<RobotFiles> read_robot_files(const std::string& directory) {
  std::error_code fault;
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(directory, fault))
    if (entry.path().extension() == ".json") paths.push_back(entry.path());
  if (fault) return fail(Fault::not_found, "robots.directory", directory + ": " + fault.message());
  std::ranges::sort(paths);
  RobotFiles files;
  std::map<std::string, std::string> file_of;  // by robot
  for (const auto& path : paths) {
    Result<robot::RobotModel> robot = read_robot_file(path.string());
    if (robot) {
      if (const auto [first, is_new] = file_of.emplace(robot->robot_id, path.filename().string()); !is_new)
        robot = invalid("/robot_id", path.string() + ": " + first->second + " has the same robot already");
    }
    if (robot)
      files.robots.emplace_back(path.string(), std::move(*robot));
    else
      files.faulty.push_back(std::move(robot.error()));
  }
  return files;
}

}  // namespace joulecast::ingest
