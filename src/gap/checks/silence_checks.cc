#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "gap/checks/evaluation.h"

namespace joulecast::gap {
namespace {

constexpr std::array<double, 2> no_interval{std::numeric_limits<double>::quiet_NaN(),
                                            std::numeric_limits<double>::quiet_NaN()};
constexpr double enough_moving_s = 3;  // less says nothing of what should have moved
constexpr double least_swing = 0.002;  // of a battery's voltage: what any converter resolves
constexpr double near_nominal = 0.25;
constexpr double noise_share = 0.05;  // of the highest reading: how far below 0 an unsigned one may stray
constexpr double supply_share = 0.5;  // of the nominal voltage: lower ones come with every halt

// A channel, or a group of readings that one channel holds.
struct Group {
  std::string_view name;
  std::size_t first, count;
  bool sides;         // each may be silent by itself
  bool may_be_level;  // one value all the time is possible for a robot that moves
};
constexpr auto groups =
    std::to_array<Group>({{"wheel_velocity", reading::wheel_velocity, 2, true, true},
                          {"motor_voltage", reading::motor_voltage, 2, true, false},
                          {"motor_current", reading::motor_current, 2, true, false},
                          {"battery_voltage", reading::battery_voltage, 1, false, false},
                          {"battery_current", reading::battery_current, 1, false, false},
                          {"velocity_command", reading::command_speed, 2, false, true},
                          {"yaw_rate", reading::yaw_rate, 1, false, false},
                          {"pitch", reading::pitch, 1, false, true},
                          {"pose", reading::x, 3, false, false},
                          {"motor_temperature", reading::motor_temperature, 2, true, true}});

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// The group's silent channels: itself, or a side of it.
template <class Silent>
std::vector<std::string> silent_channels(const CheckContext& c, const Group& group, Silent silent) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < group.count; ++k) {
    if (silent(c.tally(group.first + k))) names.emplace_back(reading_names[group.first + k]);
  }
  if (names.size() == group.count) return {std::string(group.name)};
  return group.sides ? names : std::vector<std::string>{};
}

Check dead_check(const std::vector<std::string>& dead) {
  return {
      "dead_channel",
      joined(dead),
      0,
      no_interval,
      fmt::format(
          "{} {} exactly 0 all the time while the robot moves: a sensor that is dead or was never filled in; "
          "joulecast expects NaN for what is not measured.",
          joined(dead), dead.size() == 1 ? "is" : "are"),
      true};
}

// The voltage that the battery's resistance must take off somewhere, over the voltage.
double expected_swing(const CheckContext& c) {
  const ValueTally& current = c.tally(reading::battery_current);
  if (current.known() == 0) return 0;
  return c.robot.battery.internal_resistance_ohm * (current.high() - current.low()) /
         c.robot.battery.nominal_voltage_v;
}

Check constant_check(const CheckContext& c, const std::string& channel, double value) {
  Check check{"constant_channel", channel, value, no_interval, {}, true};
  if (channel != "battery_voltage") {
    check.says = fmt::format(
        "{} is {:.5g} all the time while the robot moves: a constant written in, no measurement; "
        "joulecast expects NaN for what is not measured.",
        channel, value);
    return check;
  }
  check.contradicted = std::fabs(value / c.robot.battery.nominal_voltage_v - 1) > near_nominal;
  check.says = fmt::format(
      "battery_voltage is {:.5g} V all the time where the current must move it by {:.2g} V: a "
      "constant written in, or a converter that does not measure it. {}.",
      value, expected_swing(c) * c.robot.battery.nominal_voltage_v,
      check.contradicted ? "It is far from the file's nominal voltage, so that power is not known"
                         : "Power is the current times it; nothing is learnt from the voltage");
  return check;
}

// Motor voltages that stay near the battery's whatever the wheels do.
bool check_supply(const CheckContext& c, std::vector<Check>& checks) {
  for (std::size_t k : {0u, 1u}) {
    const ValueTally& t = c.tally(reading::motor_voltage + k);
    if (t.known() == 0 || t.constant() || t.low() < supply_share * c.robot.battery.nominal_voltage_v)
      return false;
  }
  const double volts = c.tally(reading::motor_voltage).mean();
  checks.push_back(
      {"supply_for_motor_voltage", "motor_voltage", volts, no_interval,
       fmt::format("motor_voltage stays near {:.3g} V however the wheels turn: it looks read at the supply; "
                   "joulecast expects V at the armature, positive driving forward.",
                   volts),
       true});
  return true;
}

// Currents or voltages that are positive whichever way the wheel turns. `first`: the right side's reading.
void check_unsigned(const CheckContext& c, std::size_t first, std::vector<Check>& checks) {
  constexpr std::array<std::size_t, 2> ways{2, 3};
  std::vector<std::string> sides;
  Estimate backward;
  for (std::size_t k : {0u, 1u}) {
    const ValueTally& t = c.tally(first + k);
    if (!c.has({first + k}) || t.constant() || t.low() < -noise_share * t.high()) continue;
    const BlockFit fit = fit_blocks(c.blocks(k == 0 ? Relation::ways_right : Relation::ways_left),
                                    first == reading::motor_current ? 0 : 1, ways);
    const Estimate forward = estimate(fit, 0), back = estimate(fit, 1);
    if (!forward.sure() || !back.sure() || forward.value < 0 || back.value < 0) continue;
    sides.emplace_back(reading_names[first + k]);
    backward = back;
  }
  if (sides.empty()) return;
  const std::string field = first == reading::motor_current ? "motor_current" : "motor_voltage";
  const std::string channel = sides.size() == 2 ? field : sides.front();
  checks.push_back(make_check(
      field + "_unsigned", channel, backward,
      fmt::format("{} is positive whichever way the wheel turns, {} on the average while it "
                  "turns backward: its sign is lost; joulecast expects it positive driving forward.",
                  channel, with_interval(backward.value, backward.interval()))));
  checks.back().contradicted = true;
}

}  // namespace

std::vector<Check> check_silence(const CheckContext& c) {
  if (c.moving_s() < enough_moving_s) return {};
  std::vector<Check> checks;
  std::vector<std::string> dead;
  for (const Group& group : groups) {
    const auto zeros = [](const ValueTally& t) { return t.known() > 0 && t.zeros() == t.known(); };
    for (std::string& name : silent_channels(c, group, zeros)) dead.push_back(std::move(name));
  }
  if (!dead.empty()) checks.push_back(dead_check(dead));
  for (const Group& group : groups) {
    if (group.may_be_level) continue;
    if (group.name == "battery_voltage" && expected_swing(c) < least_swing) continue;
    const auto level = [](const ValueTally& t) { return t.constant() && t.low() != 0; };
    for (const std::string& name : silent_channels(c, group, level)) {
      const auto at = std::ranges::find_if(reading_names, [&](auto r) { return belongs_to(r, name); });
      const ValueTally& t = c.tally(static_cast<std::size_t>(at - reading_names.begin()));
      checks.push_back(constant_check(c, name, t.low()));
    }
  }
  check_unsigned(c, reading::motor_current, checks);
  if (!check_supply(c, checks)) check_unsigned(c, reading::motor_voltage, checks);
  return checks;
}

}  // namespace joulecast::gap
