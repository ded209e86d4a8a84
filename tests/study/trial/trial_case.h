#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "client/virtual_robot/virtual_robot.h"

namespace joulecast::trial {

// The kind of effects in a robot.
enum class Kind { none, single, pair, outside };
[[nodiscard]] std::string_view name_of(Kind kind);
[[nodiscard]] std::optional<Kind> kind_of(std::string_view name);

// The kind of case `index`: of every twenty 9 single, 4 pairs, 4 none, 3 outside.
[[nodiscard]] Kind kind_in_turn(std::size_t index);
// How many cases of its kind come before case `index`.
[[nodiscard]] std::size_t turn_in_kind(std::size_t index);
// Card `turn` of shuffled decks of `size` cards; every deck contains each card once, its order depends on the
// seed and the purpose.
[[nodiscard]] std::size_t in_turn(std::uint64_t seed, std::uint64_t purpose, std::size_t size,
                                  std::size_t turn);

// By the absolute power gap that the effects add; slight: below 2 %, for effects with little influence on
// battery power (kinematics, battery resistance) or with a bounded gap.
enum class Strength { slight, weak, medium, strong };
[[nodiscard]] std::string_view name_of(Strength strength);
[[nodiscard]] Strength strength_of(double added_gap);

enum class ChannelChoice { full, battery, mixed };  // mixed: one case in five without motor channels

struct TrialSettings {
  std::uint64_t seed = 1;
  std::size_t count = 40;
  std::optional<Kind> only;
  std::string only_effect;  // an id of the virtual robot's table: every case has it
  ChannelChoice channels = ChannelChoice::mixed;
  bool vary_plant = true;  // half of the cases with sensors, drives and missions unlike the usual
};

// One case as drawn, before anything is driven.
struct TrialCase {
  std::size_t index = 0;
  Kind kind = Kind::none;
  std::string robot_json;                // the robot file that the diagnosis will see
  std::string robot_kind;                // of the shipped robot that it was varied from
  virtual_robot::SimulationSpec spec;    // the plant: its numbers lie a little off the robot file
  std::uint64_t seed = 0;                // of the simulation
  double added_gap = 0;                  // of all effects together
  Strength strength = Strength::slight;  // of the weakest effect
  std::vector<std::string> variants;     // in which the plant departs from the usual one
};

// Case `index` of the trial; the same settings and index give the same case, independent of other draws.
[[nodiscard]] TrialCase draw_case(const TrialSettings& settings, std::size_t index);

}  // namespace joulecast::trial
