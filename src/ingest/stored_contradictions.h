#pragma once

#include <string>
#include <vector>

#include "history/store.h"
#include "ingest/contradiction.h"

namespace joulecast::ingest {

// The contradictions in the findings of the robot's last mission that made its accounts wrong; they were
// reported at that mission's end. Empty if it had none, or if the store cannot be read.
std::vector<Contradiction> stored_contradictions(const history::Store& store, const std::string& robot_id);

}  // namespace joulecast::ingest
