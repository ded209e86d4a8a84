#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "plausibility/evidence.h"
#include "robot/robot_model.h"

namespace joulecast::plausibility {

// A wrong sign, unit or factor of one channel, or of the file's wheel radius: the factors of its readings, or
// swapped sides.
struct ChannelFault {
  std::string id, channel;
  std::string cause;  // "given in rpm"
  std::array<double, factor_count> factor;
  std::uint32_t swaps = 0;  // bits as in EvidenceTraits::turned_by
  double surprise = 0;      // negative log prior probability, in nats
};

// The catalogue of sign and unit faults, for a robot of these dimensions. A map and a clock may have a scale
// that matches no unit; its factor is taken from the evidence.
std::vector<ChannelFault> known_faults(const robot::RobotModel& robot,
                                       std::span<const ChannelEvidence> evidence = {});

// The combination of faults with the least surprise, given all evidence; those that are likely enough to be
// told.
struct FaultExplanation {
  std::vector<const ChannelFault*> faults;  // empty: no fault
  std::vector<std::vector<const ChannelFault*>>
      alternatives;  // of each fault: replacements that are about equally good
  // Of each fault, against every replacement and none in its place: probability of it, and of any.
  std::vector<double> probability, any;
};

FaultExplanation explain_faults(std::span<const ChannelEvidence> evidence,
                                std::span<const ChannelFault> faults);

// The factor of a fault, measured by the evidence that supports it most, after correction for the other
// faults.
struct Measured {
  const ChannelEvidence* evidence = nullptr;
  double factor = 1;
  std::array<double, 2> interval{};
  // True if all evidence for the fault depends on the file's gear ratio: a wrong ratio would look the same.
  bool by_gear = false;
  bool by_power = false;  // ... or on its powers
};
Measured measured_factor(std::span<const ChannelEvidence> evidence, const FaultExplanation& explanation,
                         const ChannelFault& fault);

}  // namespace joulecast::plausibility
