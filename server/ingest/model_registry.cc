#include "server/ingest/model_registry.h"

#include <mutex>
#include <utility>

namespace joulecast::server {

Result<void> ModelRegistry::put(robot::RobotModel robot, std::int64_t version) {
  Result<dynamics::DriveModel> drive = dynamics::drive_model(robot);
  if (!drive) return tl::unexpected(std::move(drive.error()));
  std::string id = robot.robot_id;
  auto model =
      std::make_shared<const ModelInForce>(ModelInForce{std::move(robot), std::move(*drive), version});
  const std::unique_lock lock(mutex_);
  models_.insert_or_assign(std::move(id), std::move(model));
  epoch_.fetch_add(1, std::memory_order_release);
  return {};
}

std::shared_ptr<const ModelInForce> ModelRegistry::find(std::string_view robot_id) const {
  const std::shared_lock lock(mutex_);
  const auto found = models_.find(robot_id);
  return found == models_.end() ? nullptr : found->second;
}

std::vector<std::shared_ptr<const ModelInForce>> ModelRegistry::all() const {
  const std::shared_lock lock(mutex_);
  std::vector<std::shared_ptr<const ModelInForce>> models;
  models.reserve(models_.size());
  for (const auto& [id, model] : models_) models.push_back(model);
  return models;
}

}  // namespace joulecast::server
