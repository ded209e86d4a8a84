#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "ingest/fleet_view.h"

namespace joulecast::ingest {

// A robot's snapshot as the daemons of a cluster hand it on.
std::vector<std::byte> snapshot_bytes(const RobotSnapshot& snapshot);

// Null for bytes that a version of the program with another layout wrote.
std::shared_ptr<const RobotSnapshot> snapshot_from_bytes(std::span<const std::byte> bytes);

}  // namespace joulecast::ingest
