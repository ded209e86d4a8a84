#pragma once

#include <string>
#include <vector>

#include "history/store.h"
#include "ingest/contradiction.h"

namespace joulecast::ingest {

// What made the robot's last mission untrue, as its findings hold it; told at that mission's end. Empty where
// nothing did, or the store cannot say.
std::vector<Contradiction> stored_contradictions(const history::Store& store, const std::string& robot_id);

}  // namespace joulecast::ingest
