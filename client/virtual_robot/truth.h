#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/virtual_robot/virtual_robot.h"

namespace joulecast::virtual_robot {

struct Truth {
  std::string robot_id;
  std::uint64_t seed = 0;
  std::vector<EffectStrength> effects;
  World world;
  std::vector<MissionTruth> missions;
};

// The injected truth as JSON: per robot its effects, the world's shapes, and true energies per mission [J].
[[nodiscard]] std::string truth_json(const std::vector<Truth>& truths);

}  // namespace joulecast::virtual_robot
