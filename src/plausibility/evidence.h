#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "plausibility/evaluation.h"

namespace joulecast::plausibility {

// Quantities that can have a wrong sign or unit.
enum class Source : std::size_t {
  wheel_right,
  wheel_left,
  voltage_right,
  voltage_left,
  current_right,
  current_left,
  battery_voltage,
  battery_current,
  yaw_rate,
  heading,
  position,
  command_speed,
  command_turn,
  pitch,
  payload
};
inline constexpr std::size_t source_count = static_cast<std::size_t>(Source::payload) + 1;

template <class T>
using Sources = std::array<T, source_count>;

// How errors of channels act on evidence.
struct EvidenceTraits {
  std::uint32_t turned_by =
      0;                    // pairs that reverse its sign when swapped (bits: wheel 1, voltage 2, current 4)
  bool magnitude = false;   // its sign is not observed
  bool by_gear = false;     // the expected value is proportional to the file's gear ratio
  bool by_power = false;    // ... to the file's powers
  bool both_sides = false;  // meaningless where the sides of a pair have different error factors
  std::vector<Source> lost_by{};  // meaningless where these are wrong by more than their sign
};

// A number determined by two or more channels and the robot file together, over the value that the file
// implies: 1 for a sound robot. Errors multiply it by the product of each source's error factor to its power.
struct ChannelEvidence : EvidenceTraits {
  std::string says;  // "the gyro reads", followed by "3.1 times" and `against`
  std::string against;
  Estimate ratio;
  std::vector<std::pair<Source, int>> powers;
  // Tolerance for sound robots: standard deviation of the ratio's logarithm, below and above 1. 0: no ratio
  // is too low (or too high).
  std::array<double, 2> off{};
  double trust = 0;  // largest penalty of an explanation by this evidence, in nats

  int power_of(Source source) const;  // 0: it does not depend on it
};

// Begins the sentence of the power that follows the motion.
inline constexpr const char* power_by_motion = "with the motion, the battery's power changes by";

// The other side of a pair, or the same.
constexpr Source side_of(Source right, std::size_t side) {
  return static_cast<Source>(static_cast<std::size_t>(right) + side);
}

// Evidence from all recorded channels that are not contradicted yet.
std::vector<ChannelEvidence> gather_evidence(const CheckContext& context);

}  // namespace joulecast::plausibility
