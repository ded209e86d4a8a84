#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "plausibility/evaluation.h"

namespace joulecast::plausibility {

// Properties of a robot: all evidence of one shares its departure from the file.
enum class Property : std::size_t {
  none,
  gyro_track,
  map_track,
  radius,
  following,  // of commands
  top_speed,
  top_turn,
  steady_power,
  accelerating_power,
  inertia,
  voltage_constant,
  resistance,
  steady_current,
  idle_power,
  driving_power
};

// Whether a property depends little on where and how the robot drives.
constexpr bool is_lasting(Property property) {
  return property >= Property::voltage_constant;
}

// The scale of utime and the wheel radius of the robot file, halved or doubled, as readings of evidence.
inline constexpr std::size_t time_scale = reading_count, half_radius = time_scale + 1,
                             double_radius = half_radius + 1, factor_count = double_radius + 1;

// How errors of channels act on evidence.
struct EvidenceTraits {
  Property property = Property::none;
  // Pairs that reverse its sign when swapped (bits: wheel 1, voltage 2, current 4).
  std::uint32_t turned_by = 0;
  bool magnitude = false;              // its sign is not observed
  bool by_gear = false;                // the expected value is proportional to the file's gear ratio
  bool by_power = false;               // ... to the file's powers
  bool heavy_tails = false;            // `off` is the scale of Student's t with three degrees of freedom
  double unexplained = 0;              // error of the ratio's logarithm by what its fit leaves unexplained
  bool both_sides = false;             // meaningless where the sides of a pair have different error factors
  std::vector<std::size_t> lost_by{};  // meaningless where these are wrong by more than their sign
};

// A number determined by two or more channels and the robot file together, over the value that the file
// implies: 1 for a sound robot. Errors multiply it by the product of each reading's error factor to its
// power; x represents both coordinates of a position.
struct ChannelEvidence : EvidenceTraits {
  std::string says;  // "the gyro reads", followed by "3.1 times" and `against`
  std::string against;
  Estimate ratio;
  std::vector<std::pair<std::size_t, double>> powers;
  // Tolerance for sound robots: standard deviation of the ratio's logarithm, below and above 1. 0: no ratio
  // is too low (or too high).
  std::array<double, 2> off{};
  double trust = 0;  // largest penalty of an explanation by this evidence, in nats
  double alike = 1;  // number of all evidence of its property, which counts once together

  double power_of(std::size_t reading) const;  // 0: it does not depend on it
};

// Constants of one motor, all at the wheel: V = R i + K w + c sgn(w), and its current at a steady mean speed.
// Robust over blocks of some seconds; unknown where its channels or the motion do not determine them.
struct MotorConstants {
  Estimate resistance_ohm;        // R
  Estimate constant_v_s_rad;      // K, gear included
  Estimate steady_current_a;      // at mean_speed_rad_s, positive in the direction of the wheel
  Estimate current_per_rad_s2_a;  // for equal acceleration of both wheels
  double mean_speed_rad_s = 0;    // while it turns
};

// [0] right, [1] left. Comparable between robots of one kind.
std::array<MotorConstants, 2> motor_constants(const CheckContext& context);

// Evidence from all recorded channels that are not contradicted yet; gathered once for all checks.
const std::vector<ChannelEvidence>& evidence_of(const CheckContext& context);

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
