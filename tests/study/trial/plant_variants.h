#pragma once

#include <string>
#include <vector>

#include "client/virtual_robot/rng.h"
#include "client/virtual_robot/virtual_robot.h"

namespace joulecast::trial {

// Departs from the usual plant in one or more ways drawn at random; returns their names.
std::vector<std::string> vary_plant(virtual_robot::Rng& rng, virtual_robot::SimulationSpec& spec);

}  // namespace joulecast::trial
