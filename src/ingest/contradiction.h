#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace joulecast::ingest {

// Kinds of faults in a robot's telemetry: labels of the metrics.
enum class ContradictionKind : std::size_t {
  sign,         // reversed, or without its sign
  scale,        // another unit
  sides,        // right and left swapped
  dead,         // 0 all the time
  constant,     // one value all the time
  limit,        // beyond the robot file's limits
  corrupt,      // readings that are thrown for a sample
  implausible,  // values or messages that no robot sends
  clock,
  sequence,
  sender,   // two under one robot id
  identity  // messages of another robot's id
};
inline constexpr std::size_t contradiction_kind_count = 12;
inline constexpr std::array<std::string_view, contradiction_kind_count> contradiction_kind_names = {
    "sign",    "scale",       "sides", "dead",     "constant", "limit",
    "corrupt", "implausible", "clock", "sequence", "sender",   "identity"};

// A channel that is contradicted by the robot's other channels, its robot file or the service's clock.
struct Contradiction {
  ContradictionKind kind = ContradictionKind::implausible;
  std::string id;       // "battery_current_reversed", "wheel_velocity_scale", "second_sender", ...
  std::string channel;  // fields of robot_telemetry_t; empty: none
  double value = 0;     // the evidence: a ratio, a share of the messages
  std::string says;     // the finding, its likely cause, and the expected value
  // The accounts of a mission with this contradiction are wrong: the mission is not used for training.
  bool untrue = false;
  std::int64_t told_utime_us = 0;  // host's, when it was last reported as an event

  bool same(const Contradiction& other) const { return id == other.id && channel == other.channel; }
};

}  // namespace joulecast::ingest
