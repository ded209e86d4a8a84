#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "missions.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::forecast {

// How virtual robots are driven: their scripts and the settling time after each leg.
struct VirtualHabit {
  const char* name;
  virtual_robot::ScriptOptions script;
  double settle_s;
};
// The first is `joulecast simulate`'s.
std::span<const VirtualHabit> virtual_habits();

// A robot of the shipped kind with a plant that departs from its file by two to four effects drawn from the
// seed; sensors are noisy, payloads change from mission to mission, days differ by `scatter`. `departing`:
// false gives a plant true to its file.
RobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed, bool departing = true,
                           const VirtualHabit& habit = virtual_habits().front());

// As above, with the effects given.
RobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed,
                           const std::vector<virtual_robot::EffectStrength>& effects,
                           const VirtualHabit& habit = virtual_habits().front());

}  // namespace joulecast::forecast
