#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gap/checks/evaluation.h"

namespace joulecast::gap {

// What can carry a wrong sign or unit.
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

// A number that two or more channels and the robot file determine together, over what the file expects: 1
// where all is well. It is multiplied by the product of what each source is wrong by, to the power of its
// exponent.
struct ChannelEvidence {
  std::string says;  // "the gyro reads", to be followed by "3.1 times what the wheels say"
  std::string against;
  Estimate ratio;
  Sources<int> exponent{};
  // How far sound robots may be off, as the standard deviation of the ratio's logarithm, below and above 1.
  // 0: it cannot be too low (or too high).
  double below = 0, above = 0;
  double trust = 0;  // most that it can count against an explanation, in nats
  std::uint32_t turned_by =
      0;                    // bits of the pairs (wheel 1, voltage 2, current 4) whose swap reverses its sign
  bool magnitude = false;   // its sign is not seen
  bool by_gear = false;     // what the file expects is proportional to its gear ratio
  bool by_power = false;    // ... to the powers of its file
  bool both_sides = false;  // means nothing where the sides of a pair are wrong by different factors
  // Means nothing where these are wrong by more than their sign.
  Sources<bool> lost_by{};
};

// Of everything that is recorded and not contradicted yet.
std::vector<ChannelEvidence> gather_evidence(const CheckContext& context);

}  // namespace joulecast::gap
