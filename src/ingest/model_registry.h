#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>

#include "answers/model.h"
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

}  // namespace joulecast::ingest
