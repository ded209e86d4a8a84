#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gap/checks/evidence.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// A wrong sign or unit of one channel: what its source is multiplied by, or sides that are swapped.
struct ChannelFault {
  std::string id, channel;
  std::string cause;  // "in rpm"
  Sources<double> factor;
  std::uint32_t swaps = 0;  // bits as in Evidence::turned_by
  double surprise = 0;      // how unlikely it is before any evidence, in nats
};

// Every sign and unit mistake that is known for a robot of these dimensions.
std::vector<ChannelFault> known_faults(const robot::RobotModel& robot);

// A map whose scale no known unit explains: off by what the evidence says.
std::optional<ChannelFault> odd_pose_scale(std::span<const ChannelEvidence> evidence);

// The least surprising way to account for all evidence at once.
struct FaultExplanation {
  std::vector<const ChannelFault*> faults;  // none: all is well
  std::vector<std::vector<const ChannelFault*>>
      alternatives;  // of each fault: others in its place that do nearly as well
  double gain = 0;   // nats by which it is better than none
};

FaultExplanation explain_faults(std::span<const ChannelEvidence> evidence,
                                std::span<const ChannelFault> faults);

// What a fault's channel is multiplied by, by the evidence that tells it best, the other faults taken out.
struct Measured {
  const ChannelEvidence* evidence = nullptr;
  double factor = 1;
  std::array<double, 2> interval{};
  // Whether all that speaks for the fault goes by the file's gear ratio: a wrong one would look the same.
  bool by_gear = false;
  bool by_power = false;  // ... or by its powers
};
Measured measured_factor(std::span<const ChannelEvidence> evidence, const FaultExplanation& explanation,
                         const ChannelFault& fault);

}  // namespace joulecast::gap
