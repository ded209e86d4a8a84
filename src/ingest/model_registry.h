#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <shared_mutex>
#include <string>
#include <string_view>
#include <vector>

#include "answers/model.h"

namespace joulecast::ingest {

using answers::model_in_force;
using answers::ModelInForce;

// The error of every answer about a robot id that does not exist.
Error unknown_robot(std::string field, std::string_view robot_id);

// The models in force, by robot. Any thread.
class ModelRegistry {
 public:
  // Puts a robot's model in force; an effect that the catalogue rejects is an error and changes nothing.
  Result<void> put(robot::RobotModel robot, std::int64_t version);

  // Puts one in force that was before.
  void put_back(std::shared_ptr<const ModelInForce> model);

  // Takes it out of force.
  void remove(std::string_view robot_id);

  // Null if the robot has no model.
  std::shared_ptr<const ModelInForce> find(std::string_view robot_id) const;

  // All, by robot id.
  std::vector<std::shared_ptr<const ModelInForce>> all() const;

  std::size_t size() const;

  // Increases with every change, so that users can detect one.
  std::uint64_t epoch() const { return epoch_.load(std::memory_order_acquire); }

 private:
  mutable std::shared_mutex mutex_;
  std::map<std::string, std::shared_ptr<const ModelInForce>, std::less<>> models_;
  std::atomic<std::uint64_t> epoch_ = 0;
};

}  // namespace joulecast::ingest
