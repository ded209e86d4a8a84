#include <algorithm>
#include <array>
#include <cmath>

#include "plausibility/evaluation.h"
#include "plausibility/evidence.h"

// A robot that departs from its file, or one of its motors from the other, without a wrong channel.
namespace joulecast::plausibility {
namespace {

constexpr double sibling_sd = 6;  // standard deviations between siblings
// Differences within a pair of motors that are not reported: magnets and windings; grease and load.
constexpr double winding_off = 0.10, motor_load_off = 0.5;
constexpr double agree = 0.35;   // of logarithms of one sensor's factor from different constants
constexpr double useless = 0.5;  // logarithm of a sensor's factor, beyond which the sensor is unusable
constexpr double over_limit = 1.5;
constexpr double far = 1.3;          // times the file's value, or its inverse
constexpr double least_idle = 0.05;  // of the power while driving; a file may omit less

// Evidence of one property, of the right and of the left motor or wheel; unknown without evidence.
std::array<Estimate, 2> sides_of(const std::vector<ChannelEvidence>& evidence, Property property,
                                 std::size_t right) {
  std::array<Estimate, 2> sides;
  for (const ChannelEvidence& e : evidence)
    for (const std::size_t k : {0u, 1u})
      if (e.property == property && !e.both_sides && e.power_of(right + k) != 0) sides[k] = e.ratio;
  return sides;
}

// Logarithm of the right motor's ratio over the left's; unknown unless both have one sign.
Estimate log_ratio(const std::array<Estimate, 2>& of) {
  const auto& [right, left] = of;
  if (!right.sure() || !left.sure() || right.value * left.value <= 0) return {};
  return {std::log(right.value / left.value), std::hypot(right.sd / right.value, left.sd / left.value),
          std::min(right.freedom, left.freedom)};
}

Estimate exponential(const Estimate& log, double sign = 1) {
  const double value = std::exp(sign * log.value);
  return {value, value * log.sd, log.freedom};
}

bool differs(const Estimate& log, double off) {
  return log.known() && std::fabs(log.value) > off && std::fabs(log.value) > sibling_sd * log.sd;
}

double distance(const Estimate& ratio) {
  return ratio.known() ? std::fabs(std::log(std::fabs(ratio.value))) : INFINITY;
}

// The side nearer to the file, as the other may have a fault of its own.
const Estimate& nearer(const std::array<Estimate, 2>& sides) {
  return distance(sides[0]) < distance(sides[1]) ? sides[0] : sides[1];
}

bool beyond(const Estimate& e, double low, double high) {
  return e.known() && (e.interval()[0] > high || e.interval()[1] < low);
}

}  // namespace

void check_limits(const CheckContext& c, Checks& checks) {
  for (const ChannelEvidence& e : evidence_of(c)) {
    const bool turn = e.property == Property::top_turn;
    if ((!turn && e.property != Property::top_speed) || e.ratio.value < over_limit) continue;
    const std::string channel = turn ? "yaw_rate" : "wheel_velocity";
    add_check(checks, turn ? "yaw_rate_over_limit" : "speed_over_limit", channel, {e.ratio.value}, false,
              "{}: {} {:.3g} times the file's {}: is it {}? joulecast expects {}.", channel, e.says,
              e.ratio.value, e.against, turn ? "in degrees" : "in rpm, or of the motor",
              contract_of(channel));
  }
}

void check_motors(const CheckContext& c, Checks& checks) {
  using namespace reading;
  if (!c.heard({0, 1, 2, 3, 4, 5})) return;
  const std::vector<ChannelEvidence>& evidence = evidence_of(c);
  const auto logarithm = [&](Property property, std::size_t right) {
    return log_ratio(sides_of(evidence, property, right));
  };
  const auto ohms = sides_of(evidence, Property::resistance, motor_voltage);
  const Estimate resistance = log_ratio(ohms),
                 constant = logarithm(Property::voltage_constant, motor_voltage),
                 inertia = logarithm(Property::inertia, motor_current);
  // Straight on, where both motors run alike at the same time; else from the fitted currents.
  const Estimate alike = c.ratio(Relation::siblings, 0, 1, 2);
  const Estimate steady = alike.sure() && alike.value > 0
                              ? log_ratio({alike, Estimate{1, 0, alike.freedom}})
                              : logarithm(Property::steady_current, motor_current);
  const bool wound = differs(resistance, winding_off), magnet = differs(constant, winding_off);
  // A current sensor that reads g times the truth: R divided by g, every current times g, K unchanged. A
  // voltage sensor: R and K times g, currents unchanged.
  const Estimate& load = differs(inertia, winding_off) ? inertia : steady;
  const bool amps =
      wound && !magnet && differs(load, winding_off) && std::fabs(load.value + resistance.value) < agree;
  const bool volts = wound && magnet && std::fabs(constant.value - resistance.value) < agree &&
                     !differs(steady, motor_load_off);
  const bool loaded = differs(steady, motor_load_off);
  if (!wound && !magnet && !loaded) return;
  std::string both;
  const auto add = [&](bool shown, const char* name, const Estimate& log) {
    if (shown) both += fmt::format("{}{} {:.3g} times", both.empty() ? "" : ", ", name, std::exp(log.value));
  };
  add(wound, "R", resistance);
  add(magnet, "K", constant);
  add(loaded || (amps && steady.known()), "current straight on", steady);
  if (!amps && !volts) {
    add_check(checks, "motor_against_sibling", "",
              exponential(wound    ? resistance
                          : magnet ? constant
                                   : steady),
              false, "The right motor has {} the left one's: two motors of one kind differ less.", both);
    return;
  }
  const std::size_t side = distance(ohms[0]) >= distance(ohms[1]) ? 0 : 1;
  const char* field = amps ? "motor_current" : "motor_voltage";
  const Estimate& log = amps ? resistance : constant;
  const Estimate gain = exponential(log, (side == 0 ? 1 : -1) * (amps ? -1 : 1));
  add_check(checks, std::string(field) + "_against_sibling", fmt::format("{}.{}", field, side_name[side]),
            gain, std::fabs(log.value) > useless,
            "The right motor has {} the left one's, as if {}.{} were {} times the true value.", both, field,
            side_name[side], with_interval(gain));
}

void check_robot_file(const CheckContext& c, Checks& checks) {
  using namespace reading;
  const std::vector<ChannelEvidence>& evidence = evidence_of(c);
  const auto power = [&](Property property) {
    const auto at = std::ranges::find(evidence, property, &ChannelEvidence::property);
    return at == evidence.end() ? Estimate{} : at->ratio;
  };
  std::string text;
  Estimate worst;
  const auto add = [&](const char* name, const Estimate& ratio) {
    if (!beyond(ratio, 1 / far, far) || !(ratio.value > 0)) return false;
    text += fmt::format("{}{} {:.3g} times", text.empty() ? "" : ", ", name, ratio.value);
    if (!worst.known() || distance(ratio) > distance(worst)) worst = ratio;
    return true;
  };
  const Estimate constant = nearer(sides_of(evidence, Property::voltage_constant, motor_voltage)),
                 friction = nearer(sides_of(evidence, Property::steady_current, motor_current));
  add("motor resistance", nearer(sides_of(evidence, Property::resistance, motor_voltage)));
  const bool other_constant = add("voltage constant with gear", constant);
  std::string gear;
  // Both depend on the gear ratio, one inversely to the other.
  if (add("friction", friction) && other_constant &&
      std::fabs(std::log(friction.value * constant.value)) < same_ratio)
    gear = fmt::format(", as with a gear_ratio {:.3g} times the robot's", 1 / constant.value);
  const dynamics::Parameters<double>& p = c.model.parameters();
  const double file_w = p.idle_power_w + p.accessory_power_w;
  const Estimate driving = c.ratio(Relation::driving, 0, 2, 2), idle = power(Property::idle_power);
  if (driving.known() && file_w >= 1 &&
      std::fabs(idle.value - 1) * file_w > least_idle * std::fabs(driving.value))
    add("idle power", idle);
  if (!friction.known()) add("power while driving", power(Property::driving_power));
  if (!text.empty())
    add_check(checks, "robot_file", "", worst, false,
              "The robot file does not match this robot: {} the file's{}.", text, gear);
}

void check_kinematics(const CheckContext& c, Checks& checks) {
  const auto departs = [&](const char* id, const char* channel, const Estimate& e, double from, double off,
                           const std::string& says) {
    if (beyond(e, from - off, from + off)) add_check(checks, id, channel, e, false, "{}", says);
  };
  const double radius_m = c.robot.kinematics.wheel_radius_m, half_track_m = c.robot.kinematics.half_track_m;
  // The turning of the robot by the gyro, else by the map, per turning of the wheels' difference and sum.
  BlockFit turning = fit_blocks(c.blocks(Relation::gyro), 0, {1, 2, 3});
  const bool gyro = turning.known();
  if (!gyro) turning = fit_blocks(c.blocks(Relation::heading_wheels), 0, {2, 3});
  const char *turner = gyro ? "the gyro" : "the map's heading", *channel = gyro ? "yaw_rate" : "pose.heading";
  Eigen::VectorXd apart = Eigen::VectorXd::Zero(gyro ? 3 : 2), together = apart;
  apart.head(2) << 1, -1;
  together.head(2) << 1, 1;
  if (const Estimate turn = estimate(turning, apart); turn.sure() && turn.value > 0) {
    const double ratio = radius_m / half_track_m / turn.value;
    const Estimate track{ratio, ratio * turn.sd / turn.value, turn.freedom};
    const Estimate sides = estimate(turning, together) * (2 / turn.value);  // (r right - r left) / r
    departs("track_against_gyro", channel, track, 1, 0.15,
            fmt::format("Where {} turns by 1 rad the wheels turn by {:.3g} rad according to the file: "
                        "half_track_m of {:.3g} m would have to be {} m, {:.3g} times as much{}.",
                        turner, ratio, half_track_m, with_interval(track * half_track_m), ratio,
                        ratio > 1
                            ? "; skid steering causes this, and so do encoders that are counted twice or more"
                            : "; encoders of which a part is counted cause this"));
    departs(
        "sides_against_gyro", channel, sides, 0, 0.05,
        fmt::format("By {} the robot turns while both wheels turn alike: the right wheel moves it by {} of "
                    "the radius more than the left one.",
                    turner, with_interval(sides)));
  }
  // The last term represents a late map.
  const BlockFit slip = fit_blocks(c.blocks(Relation::slip), 0, {1, 2, 3, 4});
  const Estimate radius = slip.known() ? estimate(slip, 0) : c.coefficient(Relation::distance, 0, {1});
  if (radius.sure()) {
    departs("radius_against_pose", "pose", radius, 1, 0.10,
            fmt::format("The map moves {} times as far as the wheels report: wheel_radius_m of {:.3g} m "
                        "would have to be {:.3g} m, or the wheels slip.",
                        with_interval(radius), radius_m, radius.value * radius_m));
    for (const Eigen::Index k : {1, 2}) {
      const Estimate part = estimate(slip, k) * (1 / radius.value);
      departs(k == 1 ? "slip_in_turns" : "slip_in_braking", "pose", part, 0, 0.10,
              fmt::format(
                  "In {} the map moves {:.3g} of the wheels' distance {} than otherwise: the wheels slip.",
                  k == 1 ? "turns" : "braking", std::fabs(part.value), part.value < 0 ? "less" : "more"));
    }
  }
  const BlockFit heading = fit_blocks(c.blocks(Relation::heading_gyro), 0, {2, 3});
  const Estimate gain = estimate(heading, 0), drift = estimate(heading, 1) * -1;
  if (!gain.sure()) return;
  departs("heading_against_gyro", "yaw_rate", gain, 1, 0.10,
          fmt::format("The map's heading turns {} times as far as the gyro reports.", with_interval(gain)));
  departs("gyro_drift", "yaw_rate", drift, 0, 0.01,
          fmt::format("The gyro reads {} rad/s where the map's heading is constant.", with_interval(drift)));
}

}  // namespace joulecast::plausibility
