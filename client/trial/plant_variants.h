#pragma once

#include <string>
#include <vector>

#include "client/virtual_robot/rng.h"
#include "client/virtual_robot/virtual_robot.h"

namespace joulecast::trial {

// Every way in which a plant may be unlike the usual one.
[[nodiscard]] std::vector<std::string> variant_names();

// Departs from the usual plant in one or more ways drawn at random; returns their names.
std::vector<std::string> vary_plant(virtual_robot::Rng& rng, virtual_robot::SimulationSpec& spec);

}  // namespace joulecast::trial
