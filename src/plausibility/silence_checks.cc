#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "plausibility/evaluation.h"
#include "plausibility/evidence.h"
#include "plausibility/faults.h"

namespace joulecast::plausibility {
namespace {

constexpr double min_moving_s = 3;     // in less, readings need not change
constexpr double least_swing = 0.002;  // of a battery's voltage; any converter resolves it
constexpr double near_nominal = 0.25;
constexpr double noise_share = 0.05;  // of the highest reading; noise below 0 of an unsigned one
// If the wheels read one value for this long, other channels are searched for changes of motion. Variations
// by these shares of the file's values are far beyond noise and drift: of the yaw rate, of the commanded
// speed, of the voltage induced by turning.
constexpr double level_s = 10;
constexpr double turning_varies = 0.05, command_varies = 0.1, voltage_varies = 0.1;
constexpr double voltage_moves =
    0.1;                            // of the nominal voltage; drop under load of a battery that is not empty
constexpr double full_duty = 0.05;  // of the voltage, unexplained by current and speed: friction of brushes
constexpr double supply_share = 0.5;  // of the nominal voltage; every halt has lower ones

// A channel, or a group of readings in one channel.
struct Group {
  std::string_view name;
  std::size_t first, count;
  bool sides;         // each may be silent alone
  bool may_be_level;  // may be constant while the robot moves
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

std::string joined(const std::vector<std::string>& names, const char* between = ", ") {
  return fmt::format("{}", fmt::join(names, between));
}

std::string by(const std::string& witnesses) {
  return witnesses.empty() ? witnesses : " by " + witnesses;
}

// Silent channels of the group: the group, or one side of it.
template <class Silent>
std::vector<std::string> silent_channels(const CheckContext& c, const Group& group, Silent silent) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < group.count; ++k) {
    if (silent(c.tally(group.first + k))) names.emplace_back(reading_names[group.first + k]);
  }
  if (names.size() == group.count) return {std::string(group.name)};
  return group.sides ? names : std::vector<std::string>{};
}

// Standard deviation of a quantity; `one` is the index of the constant.
double deviation(std::span<const Products::Block> blocks, Eigen::Index k, Eigen::Index one) {
  double rows = 0, sum = 0, square = 0;
  for (const auto& block : blocks) rows += block.rows, sum += block.sums(k, one), square += block.sums(k, k);
  return rows > 0 ? std::sqrt(std::max(square / rows - sum * sum / (rows * rows), 0.0)) : 0;
}

// Evidence that the robot's motion changes although its wheel readings are constant. A robot that is held
// fast receives commands, too, but its battery does not follow them.
std::string witnesses_of_motion(const CheckContext& c) {
  const robot::Limits& limits = c.robot.limits;
  std::vector<std::string> names;
  double map_moving_s = 0, map_standing_s = 0;
  for (const Observation& o : c.seen) map_moving_s += o.map_moving_s, map_standing_s += o.map_standing_s;
  const bool stand = c.tally(reading::wheel_velocity).high() == 0 && c.tally(1).high() == 0;
  if (deviation(c.blocks(Relation::yaw), 0, 1) > turning_varies * limits.yaw_rate_rad_s)
    names.emplace_back("its gyro");
  if (map_moving_s > level_s && (stand || map_standing_s > level_s)) names.emplace_back("its map");
  const auto emf = c.blocks(Relation::back_emf);
  const double least_v = voltage_varies * c.robot.battery.nominal_voltage_v;
  if (std::max(deviation(emf, 0, 2), deviation(emf, 1, 2)) > least_v) names.emplace_back("its motors");
  const auto commanded = c.blocks(Relation::commanded);
  const Estimate follows = estimate(fit_blocks(commanded, 0, {1, 2}), 0);
  if (deviation(commanded, 1, 2) > command_varies * limits.speed_m_s / c.robot.kinematics.wheel_radius_m &&
      follows.sure() && follows.value > 0)
    names.emplace_back("its battery that follows the commands");
  return joined(names, " and ");
}

// The same, if both wheels read one value throughout; else empty.
std::string witnesses_against_wheels(const CheckContext& c) {
  double length_s = 0;
  for (const Observation& o : c.seen) length_s += o.clock.length_s();
  if (!c.tally(0).constant() || !c.tally(1).constant() || length_s < level_s) return {};
  return witnesses_of_motion(c);
}

// Change of voltage that the battery's internal resistance must cause, over the nominal voltage.
double expected_swing(const CheckContext& c) {
  const ValueTally& current = c.tally(reading::battery_current);
  if (current.known() == 0) return 0;
  return c.robot.battery.internal_resistance_ohm * (current.high() - current.low()) /
         c.robot.battery.nominal_voltage_v;
}

void check_constant(const CheckContext& c, const std::string& channel, double value,
                    const std::string& witnesses, Checks& checks) {
  if (channel != "battery_voltage") {
    add_check(checks, "constant_channel", channel, value, true,
              "{} is {:.5g} all the time while the robot moves{}: a constant written in, no measurement; "
              "joulecast expects NaN for what is not measured.",
              channel, value, by(witnesses));
    return;
  }
  const double nominal_v = c.robot.battery.nominal_voltage_v;
  const bool off = std::fabs(value / nominal_v - 1) > near_nominal;
  add_check(checks, "constant_channel", channel, value, off,
            "battery_voltage is {:.5g} V all the time where the current must move it by {:.2g} V: a constant "
            "written in, or a converter that does not measure it. {}.",
            value, expected_swing(c) * nominal_v,
            off ? "It is far from the file's nominal voltage, so that power is not known"
                : "Power is the current times it; nothing is learnt from the voltage");
}

// Root mean square of a motor's voltage beyond R i + K w of the file, over that of the voltage.
double beyond_armature(const CheckContext& c, std::size_t side) {
  const dynamics::Parameters<double>& p = c.model.parameters();
  const Eigen::Vector3d armature{1, -p.resistance_ohm[side], -p.voltage_constant_v_s_rad};
  double rest = 0, all = 0;
  for (const auto& block : c.blocks(side == 0 ? Relation::armature_right : Relation::armature_left)) {
    rest += armature.dot(block.sums.topLeftCorner<3, 3>() * armature);
    all += block.sums(0, 0);
  }
  return all > 0 ? std::sqrt(std::max(rest, 0.0) / all) : 1;
}

// Detects motor voltages that stay near the battery's, independent of the wheels: a motor at full duty has
// them too, and its current and speed account for them.
bool check_supply(const CheckContext& c, Checks& checks) {
  if (std::max(beyond_armature(c, 0), beyond_armature(c, 1)) < full_duty) return false;
  for (std::size_t k : {0u, 1u}) {
    const ValueTally& t = c.tally(reading::motor_voltage + k);
    if (t.known() == 0 || t.constant() || t.low() < supply_share * c.robot.battery.nominal_voltage_v)
      return false;
  }
  const double volts = c.tally(reading::motor_voltage).mean();
  add_check(
      checks, "supply_for_motor_voltage", "motor_voltage", volts, true,
      "motor_voltage stays near {:.3g} V however the wheels turn: it looks read at the supply; joulecast "
      "expects V at the armature, positive driving forward.",
      volts);
  return true;
}

// True if the sides or signs of the wheels are wrong: correct readings then appear unsigned.
bool wheels_look_wrong(const CheckContext& c) {
  const std::vector<ChannelEvidence> evidence = gather_evidence(c);
  const std::vector<ChannelFault> faults = known_faults(c.robot);
  return std::ranges::any_of(explain_faults(evidence, faults).faults,
                             [](const ChannelFault* f) { return f->channel.starts_with("wheel_velocity"); });
}

// Detects currents or voltages that are positive in both directions of the wheel. `first`: the right side's
// reading.
void check_unsigned(const CheckContext& c, std::size_t first, Checks& checks) {
  std::vector<std::string> sides;
  Estimate backward;
  for (std::size_t k : {0u, 1u}) {
    const ValueTally& t = c.tally(first + k);
    if (!c.has({first + k}) || t.constant() || t.low() < -noise_share * t.high()) continue;
    const BlockFit fit = fit_blocks(c.blocks(k == 0 ? Relation::ways_right : Relation::ways_left),
                                    first == reading::motor_current ? 0 : 1, {2, 3});
    const Estimate forward = estimate(fit, 0), back = estimate(fit, 1);
    if (!forward.sure() || !back.sure() || forward.value < 0 || back.value < 0) continue;
    sides.emplace_back(reading_names[first + k]);
    backward = back;
  }
  if (sides.empty() || (sides.size() == 1 && wheels_look_wrong(c))) return;
  const std::string field = first == reading::motor_current ? "motor_current" : "motor_voltage";
  const std::string channel = sides.size() == 2 ? field : sides.front();
  checks.push_back(make_check(
      field + "_unsigned", channel, backward,
      fmt::format("{} is positive whichever way the wheel turns, {} on the average while it "
                  "turns backward: its sign is lost; joulecast expects it positive driving forward.",
                  channel, with_interval(backward.value, backward.interval()))));
  checks.back().contradicted = true;
}

// Detects a current near the nominal voltage with a voltage that is implausible for the battery: both are
// swapped.
void check_battery_swap(const CheckContext& c, Checks& checks) {
  if (!c.has({reading::battery_voltage, reading::battery_current})) return;
  const ValueTally &volts = c.tally(reading::battery_voltage), &amps = c.tally(reading::battery_current);
  const double nominal = c.robot.battery.nominal_voltage_v;
  const bool current_is_voltage =
      std::fabs(amps.mean() / nominal - 1) < near_nominal && amps.deviation() < voltage_moves * nominal;
  const bool voltage_is_none =
      std::fabs(volts.mean()) < supply_share * nominal || std::fabs(volts.mean()) > nominal / supply_share;
  if (!current_is_voltage || !voltage_is_none) return;
  add_check(
      checks, "battery_swapped", "battery_voltage, battery_current", amps.mean() / nominal, true,
      "battery_voltage is {:.3g} V on the average and battery_current {:.3g} A, always near the nominal "
      "{:.3g} V: they look swapped; joulecast expects V, and A that are positive while discharging.",
      volts.mean(), amps.mean(), nominal)
      .swapped = true;
}

}  // namespace

void check_silence(const CheckContext& c, Checks& checks) {
  const std::string witnesses = witnesses_against_wheels(c);
  if (c.moving_s() < min_moving_s && witnesses.empty()) return;
  std::vector<std::string> dead;
  for (const Group& group : groups) {
    const auto zeros = [](const ValueTally& t) { return t.known() > 0 && t.zeros() == t.known(); };
    for (std::string& name : silent_channels(c, group, zeros)) dead.push_back(std::move(name));
  }
  if (!dead.empty())
    add_check(
        checks, "dead_channel", joined(dead), 0, true,
        "{} {} exactly 0 all the time while the robot moves{}: a sensor that is dead or was never filled "
        "in; joulecast expects NaN for what is not measured.",
        joined(dead), dead.size() == 1 ? "is" : "are", by(witnesses));
  for (const Group& group : groups) {
    const bool wheels = group.first == reading::wheel_velocity;
    if (group.may_be_level && !(wheels && !witnesses.empty())) continue;
    if (group.name == "battery_voltage" && expected_swing(c) < least_swing) continue;
    const auto level = [](const ValueTally& t) { return t.constant() && t.low() != 0; };
    for (const std::string& name : silent_channels(c, group, level)) {
      const auto at = std::ranges::find_if(reading_names, [&](auto r) { return belongs_to(r, name); });
      const ValueTally& t = c.tally(static_cast<std::size_t>(at - reading_names.begin()));
      check_constant(c, name, t.low(), wheels ? witnesses : "", checks);
    }
  }
  check_battery_swap(c, checks);
  check_unsigned(c, reading::motor_current, checks);
  if (!check_supply(c, checks)) check_unsigned(c, reading::motor_voltage, checks);
}

}  // namespace joulecast::plausibility
