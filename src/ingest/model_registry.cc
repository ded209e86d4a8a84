#include "ingest/model_registry.h"

#include <mutex>
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

void ModelRegistry::put_back(std::shared_ptr<const ModelInForce> model) {
  const std::unique_lock lock(mutex_);
  const std::string& id = model->robot.robot_id;
  models_.insert_or_assign(id, std::move(model));
  epoch_.fetch_add(1, std::memory_order_release);
}

void ModelRegistry::remove(std::string_view robot_id) {
  const std::unique_lock lock(mutex_);
  if (const auto found = models_.find(robot_id); found != models_.end()) models_.erase(found);
  epoch_.fetch_add(1, std::memory_order_release);
}

std::shared_ptr<const ModelInForce> ModelRegistry::find(std::string_view robot_id) const {
  const std::shared_lock lock(mutex_);
  const auto found = models_.find(robot_id);
  return found == models_.end() ? nullptr : found->second;
}

std::size_t ModelRegistry::size() const {
  const std::shared_lock lock(mutex_);
  return models_.size();
}

std::vector<std::shared_ptr<const ModelInForce>> ModelRegistry::all() const {
  const std::shared_lock lock(mutex_);
  std::vector<std::shared_ptr<const ModelInForce>> models;
  models.reserve(models_.size());
  for (const auto& [id, model] : models_) models.push_back(model);
  return models;
}

}  // namespace joulecast::ingest
