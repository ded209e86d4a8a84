#include "ingest/model_registry.h"

#include <utility>

#include "base/try.h"

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

}  // namespace joulecast::ingest
