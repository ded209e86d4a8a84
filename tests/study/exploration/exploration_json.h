#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>

#include "tests/study/exploration/explore.h"
#include "tests/study/exploration/mission_energy.h"

namespace joulecast::exploration {

// The exploration log and the energy of the mission: the map as its file, every round with its scan and
// candidates (a dropped one shows null nodes), motions in order, energy by payload. Units end the names.
nlohmann::json to_json(const Map& map, const Exploration& exploration, std::span<const MissionEnergy> energy);

}  // namespace joulecast::exploration
