#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "plausibility/evaluation.h"
#include "plausibility/evidence.h"

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

// Constant readings of the channel, 0 or not: the channel, or sides of it, each with its value.
std::vector<std::pair<std::string, double>> constant_readings(const CheckContext& c, const Channel& channel,
                                                              bool zero) {
  std::vector<std::pair<std::string, double>> found;
  for (std::size_t k = channel.first; k < channel.first + channel.count; ++k)
    if (const ValueTally& t = c.tally(k); t.constant() && (t.low() == 0) == zero)
      found.emplace_back(reading_names[k], t.low());
  if (found.size() == channel.count) return {{std::string(channel.name), found.front().second}};
  if (!channel.sides) found.clear();
  return found;
}

// Standard deviation of a quantity; `one` is the index of the constant.
double deviation(std::span<const Products::Block> blocks, Eigen::Index k, Eigen::Index one) {
  double rows = 0, sum = 0, square = 0;
  for (const auto& block : blocks) rows += block.rows, sum += block.sums(k, one), square += block.sums(k, k);
  return rows > 0 ? std::sqrt(std::max(square / rows - sum * sum / (rows * rows), 0.0)) : 0;
}

// Evidence that the robot's motion changes, if both wheels read one value throughout; else empty. A robot
// that is held fast receives commands, too, but its battery does not follow them.
std::string witnesses_against_wheels(const CheckContext& c) {
  const ValueTally &right = c.tally(0), &left = c.tally(1);
  if (!right.constant() || !left.constant() ||
      c.sum([](const Observation& o) { return o.clock.length_s(); }) < level_s)
    return {};
  const robot::Limits& limits = c.robot.limits;
  const auto emf = c.blocks(Relation::back_emf), commanded = c.blocks(Relation::commanded);
  const double moving_s = c.sum(&Observation::map_moving_s), standing_s = c.sum(&Observation::map_standing_s);
  const double command_rad_s = command_varies * limits.speed_m_s / c.robot.kinematics.wheel_radius_m;
  const double emf_v = voltage_varies * c.robot.battery.nominal_voltage_v;
  const Estimate follows = c.coefficient(Relation::commanded, 0, {1, 2});
  std::vector<std::string> names;
  if (deviation(c.blocks(Relation::yaw), 0, 1) > turning_varies * limits.yaw_rate_rad_s)
    names.emplace_back("its gyro");
  if (moving_s > level_s && ((right.high() == 0 && left.high() == 0) || standing_s > level_s))
    names.emplace_back("its map");
  if (std::max(deviation(emf, 0, 2), deviation(emf, 1, 2)) > emf_v) names.emplace_back("its motors");
  if (deviation(commanded, 1, 2) > command_rad_s && follows.sure() && follows.value > 0)
    names.emplace_back("its battery that follows the commands");
  return fmt::format("{}", fmt::join(names, " and "));
}

// A battery's voltage that must change by its internal resistance, and does not.
void check_constant_voltage(const CheckContext& c, double value, Checks& checks) {
  const ValueTally& current = c.tally(reading::battery_current);
  const double nominal_v = c.robot.battery.nominal_voltage_v;
  const double swing_v = c.robot.battery.internal_resistance_ohm * (current.high() - current.low());
  if (swing_v < least_swing * nominal_v) return;
  const bool off = std::fabs(value / nominal_v - 1) > near_nominal;
  add_check(checks, "constant_channel", "battery_voltage", {value}, off,
            "battery_voltage is {:.5g} V all the time where the current must move it by {:.2g} V: a constant "
            "value, or a converter that does not measure it. {}.",
            value, swing_v,
            off ? "It is far from the file's nominal voltage, so that power is unknown"
                : "Power is computed with it; the voltage itself has no information");
}

void check_constant(const CheckContext& c, const std::string& witnesses, Checks& checks) {
  const auto measured = std::span(channel_table).first(channel_table.size() - 1);  // payloads are stated
  std::vector<std::string> dead;
  for (const Channel& channel : measured)
    for (const auto& [name, value] : constant_readings(c, channel, true)) dead.push_back(name);
  const std::string by = witnesses.empty() ? "" : " by " + witnesses;
  if (!dead.empty()) {
    const std::string all = fmt::format("{}", fmt::join(dead, ", "));
    add_check(checks, "dead_channel", all, {0}, true,
              "{} {} exactly 0 all the time while the robot moves{}: {} off, or the field is never set; "
              "joulecast expects NaN for what is not measured.",
              all, dead.size() == 1 ? "is" : "are", by,
              all.starts_with("motor_voltage, motor_current") ? "the motors are" : "the sensor is");
  }
  for (const Channel& channel : measured) {
    const bool wheels = channel.first == reading::wheel_velocity;
    if (wheels ? witnesses.empty() : channel.may_be_level) continue;
    for (const auto& [name, value] : constant_readings(c, channel, false)) {
      if (channel.first == reading::battery_voltage)
        check_constant_voltage(c, value, checks);
      else
        add_check(checks, "constant_channel", name, {value}, true,
                  "{} is {:.5g} all the time while the robot moves{}: a constant, not a measurement; "
                  "joulecast expects NaN for what is not measured.",
                  name, value, wheels ? by : "");
    }
  }
}

// Root mean square of a motor's voltage beyond R i + K w of the file, over that of the voltage.
double beyond_armature(const CheckContext& c, std::size_t side) {
  const dynamics::Parameters<double>& p = c.model.parameters();
  const Eigen::Vector3d armature{1, -p.resistance_ohm[side], -p.voltage_constant_v_s_rad};
  double rest = 0, all = 0;
  for (const auto& block : c.blocks(of_side(Relation::armature_right, side))) {
    rest += armature.dot(block.sums.topLeftCorner<3, 3>() * armature);
    all += block.sums(0, 0);
  }
  return all > 0 ? std::sqrt(std::max(rest, 0.0) / all) : 1;
}

// Detects motor voltages that stay near the battery's, independent of the wheels: a motor at full duty has
// them too, and its current and speed account for them.
bool check_supply(const CheckContext& c, Checks& checks) {
  if (std::max(beyond_armature(c, 0), beyond_armature(c, 1)) < full_duty) return false;
  for (const std::size_t k : {reading::motor_voltage, reading::motor_voltage + 1})
    if (const ValueTally& t = c.tally(k);
        t.known() == 0 || t.constant() || t.low() < supply_share * c.robot.battery.nominal_voltage_v)
      return false;
  const double volts = c.tally(reading::motor_voltage).mean();
  add_check(checks, "supply_for_motor_voltage", "motor_voltage", {volts}, true,
            "motor_voltage stays near {:.3g} V however the wheels turn: it looks read at the supply; "
            "joulecast expects V at the armature, positive driving forward.",
            volts);
  return true;
}

// True if the readings of the wheels are wrong: correct readings then appear unsigned.
bool wheels_look_wrong(const CheckContext& c) {
  Checks checks;
  check_faults(c, checks);
  return std::ranges::any_of(
      checks, [](const Check& k) { return k.contradicted && k.channel.starts_with("wheel_velocity"); });
}

bool never_negative(const ValueTally& t) {
  return !t.constant() && t.low() >= -noise_share * t.high();
}

// Detects a battery's current without a sign: a battery that is charged has a higher voltage, by as much as
// discharging lowers it. A smaller rise has another cause. Wheels tell when it is charged.
void check_unsigned_battery(const CheckContext& c, Checks& checks) {
  if (!never_negative(c.tally(reading::battery_current))) return;
  const BlockFit fit = fit_blocks(c.blocks(Relation::sag), 0, {1, 2});
  const Estimate driving = estimate(fit, 0), charging = estimate(fit, Eigen::Vector2d(1, 1));
  if (!driving.sure() || driving.value > 0 || !charging.sure() || charging.value < 0) return;
  const Estimate ratio = charging * (-1 / driving.value);
  if (ratio.interval()[1] < 1 || wheels_look_wrong(c)) return;
  add_check(checks, "battery_current_unsigned", "battery_current", ratio, true,
            "battery_current is never negative, and while the motors charge the battery its voltage rises "
            "with it, {} times as much as it falls otherwise: its sign is lost; joulecast expects it "
            "positive while discharging.",
            with_interval(ratio));
}

// Detects currents or voltages that are positive in both directions of the wheel.
void check_unsigned(const CheckContext& c, std::size_t first, Checks& checks) {
  const bool amps = first == reading::motor_current;
  const std::string field = amps ? "motor_current" : "motor_voltage";
  std::vector<std::string> sides;
  Estimate backward;
  for (std::size_t k : {0u, 1u}) {
    if (!never_negative(c.tally(first + k))) continue;
    const BlockFit fit = amps ? fit_blocks(c.blocks(of_side(Relation::torque_right, k)), 0, {1, 6})
                              : fit_blocks(c.blocks(of_side(Relation::armature_right, k)), 0, {3, 5});
    const Estimate forward = estimate(fit, Eigen::Vector2d(1, 1)),
                   back = estimate(fit, Eigen::Vector2d(-1, 1));
    if (!forward.sure() || !back.sure() || forward.value < 0 || back.value < 0) continue;
    sides.emplace_back(reading_names[first + k]);
    backward = back;
  }
  if (sides.empty() || (sides.size() == 1 && wheels_look_wrong(c))) return;
  const std::string channel = sides.size() == 2 ? field : sides.front();
  add_check(checks, field + "_unsigned", channel, backward, true,
            "{} is positive whichever way the wheel turns, {} on average while it turns backward: its "
            "sign is lost; joulecast expects it positive driving forward.",
            channel, with_interval(backward));
}

// Detects a current near the nominal voltage with a voltage that is implausible for the battery: both are
// swapped.
void check_battery_swap(const CheckContext& c, Checks& checks) {
  const ValueTally &volts = c.tally(reading::battery_voltage), &amps = c.tally(reading::battery_current);
  if (volts.known() == 0 || amps.known() == 0 ||
      !c.heard({reading::battery_voltage, reading::battery_current}))
    return;
  const double nominal = c.robot.battery.nominal_voltage_v;
  const bool current_is_voltage =
      std::fabs(amps.mean() / nominal - 1) < near_nominal && amps.deviation() < voltage_moves * nominal;
  const bool voltage_is_none =
      std::fabs(volts.mean()) < supply_share * nominal || std::fabs(volts.mean()) > nominal / supply_share;
  if (!current_is_voltage || !voltage_is_none) return;
  add_check(checks, "battery_swapped", "battery_voltage, battery_current", {amps.mean() / nominal}, true,
            "battery_voltage is {:.3g} V on average and battery_current {:.3g} A, always near the nominal "
            "{:.3g} V: they look swapped; joulecast expects V, and A that are positive while discharging.",
            volts.mean(), amps.mean(), nominal)
      .swapped = true;
}

}  // namespace

void check_silence(const CheckContext& c, Checks& checks) {
  const std::string witnesses = witnesses_against_wheels(c);
  if (c.sum(&Observation::moving_s) < min_moving_s && witnesses.empty()) return;
  check_constant(c, witnesses, checks);
  check_battery_swap(c, checks);
  check_unsigned_battery(c, checks);
  check_unsigned(c, reading::motor_current, checks);
  if (!check_supply(c, checks)) check_unsigned(c, reading::motor_voltage, checks);
}

}  // namespace joulecast::plausibility
