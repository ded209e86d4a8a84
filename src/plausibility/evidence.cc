#include "plausibility/evidence.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "plausibility/motors.h"
#include "plausibility/readings.h"

namespace joulecast::plausibility {
namespace {

using S = Source;

S side_of(S right, std::size_t side) {
  return static_cast<S>(static_cast<std::size_t>(right) + side);
}

// Deviations of sound robots from their file, as standard deviations of logarithms. Electrical constants of
// another motor of the size: a third; its resistance with leads, brushes and heat: a factor of two; friction
// and power: a factor of three, the spread between floors of the Husky recordings. Skid-steered robots turn a
// third as much as their wheel speeds imply (Mandow and others 2007: effective tracks are 1.5 to 3 times as
// wide as actual ones).
constexpr double constant_off = 0.35, resistance_off = 0.7, load_off = 1.1, inertia_off = 0.7;
constexpr double skid = 0.7, track_off = 0.2, travel_off = 0.2, heading_off = 0.1, command_off = 0.3;
constexpr double driver_off = 0.5, regeneration_off = 0.3, voltage_off = 0.25, limit_off = 0.3;
// Trust in evidence against a sign where the magnitudes of both sides agree with the file: no sound robot
// produces it.
constexpr double surely_trust = 12, alike_sides = 0.1;
constexpr double anything = 1e3;
constexpr double steepest_rad = 0.35;
constexpr double unused_off = 1.5;  // limits need not be reached

class Gatherer {
 public:
  explicit Gatherer(const CheckContext& context)
      : c_(context),
        robot_(context.robot),
        p_(context.model.parameters()),
        motors_(motor_constants(context.seen, context.motor_delay_s)) {}

  std::vector<ChannelEvidence> gather() {
    armatures();
    torques();
    turning();
    moving();
    batteries();
    loads();
    limits();
    return std::move(found_);
  }

 private:
  std::vector<Products::Block> blocks(Relation r) const { return c_.blocks(r); }
  bool heard(std::initializer_list<std::size_t> readings) const { return c_.heard(readings); }
  // Adds evidence if its ratio is significantly different from 0; else returns a scratch entry.
  ChannelEvidence& add(std::string says, std::string against, const Estimate& ratio, double below,
                       double above, double trust, std::initializer_list<std::pair<S, int>> exponents) {
    ChannelEvidence& e = ratio.sure() ? found_.emplace_back() : scratch_;
    e.says = std::move(says);
    e.against = std::move(against);
    e.ratio = ratio;
    e.below = below;
    e.above = above;
    e.trust = trust;
    for (const auto& [source, power] : exponents) e.exponent[static_cast<std::size_t>(source)] = power;
    return e;
  }
  static void lost(ChannelEvidence& e, std::initializer_list<S> sources) {
    for (const S s : sources) e.lost_by[static_cast<std::size_t>(s)] = true;
  }

  const ValueTally& tally(std::size_t k) const { return c_.tally(k); }
  std::optional<double> mean_of(std::size_t k) const {
    return tally(k).known() > 1 ? std::optional(tally(k).mean()) : std::nullopt;
  }

  void armatures();
  void torques();
  void turning();
  static double trust_of_sides(const Estimate& right, const Estimate& left, double else_trust);
  void turning_by_wheels(const BlockFit& fit, const std::string& turner, S source);
  void moving();
  void batteries();
  void loads();
  void limits();

  const CheckContext& c_;
  const robot::RobotModel& robot_;
  const dynamics::Parameters<double>& p_;
  std::array<MotorConstants, 2> motors_;
  std::vector<ChannelEvidence> found_;
  ChannelEvidence scratch_;
};

void Gatherer::armatures() {
  for (std::size_t k : {0u, 1u}) {
    if (!heard({reading::wheel_velocity + k, reading::motor_voltage + k, reading::motor_current + k}))
      continue;
    const std::string side = side_name[k];
    add("the " + side + " motor's voltage constant, from its voltage, current and speed, is", "the file's",
        motors_[k].constant_v_s_rad * (1 / p_.voltage_constant_v_s_rad), constant_off, constant_off, 12,
        {{side_of(S::voltage_right, k), 1}, {side_of(S::wheel_right, k), -1}})
        .by_gear = true;
    add("the " + side + " motor's resistance, from its voltage, current and speed, is", "the file's",
        motors_[k].resistance_ohm * (1 / p_.resistance_ohm[k]), resistance_off, resistance_off, 8,
        {{side_of(S::voltage_right, k), 1}, {side_of(S::current_right, k), -1}});
  }
  if (!heard({0, 1, 2, 3, 4, 5})) return;
  const BlockFit fit = fit_armature(c_.seen, Relation::armature_difference, c_.motor_delay_s);
  const auto sides = [](ChannelEvidence& e, std::uint32_t pairs) {
    e.turned_by = pairs, e.both_sides = true;
  };
  ChannelEvidence& constant = add("the voltage constant, from the differences of the sides, is", "the file's",
                                  estimate(fit, 1) * (1 / p_.voltage_constant_v_s_rad), constant_off,
                                  constant_off, 12, {{S::voltage_right, 1}, {S::wheel_right, -1}});
  constant.by_gear = true;
  sides(constant, 1 | 2);
  sides(add("the resistance, from the differences of the sides, is", "the file's",
            estimate(fit, 0) * (2 / (p_.resistance_ohm[0] + p_.resistance_ohm[1])), resistance_off,
            resistance_off, 10, {{S::voltage_right, 1}, {S::current_right, -1}}),
        2 | 4);
}

void Gatherer::torques() {
  const double radius = 0.5 * (p_.wheel_radius_m[0] + p_.wheel_radius_m[1]);
  const double load = mean_of(reading::payload).value_or(0);
  const double inertia = 0.5 * robot_.total_mass_kg(load) * radius * radius + p_.wheel_inertia_kg_m2;
  for (std::size_t k : {0u, 1u}) {
    if (!heard({reading::wheel_velocity + k, reading::motor_current + k})) continue;
    const MotorConstants& m = motors_[k];
    const std::string side = side_name[k];
    add("the " + side + " motor's current for acceleration is", "what the file's inertia gives",
        m.current_per_rad_s2_a * (p_.torque_constant_nm_a / inertia), inertia_off, inertia_off, 6,
        {{side_of(S::current_right, k), 1}, {side_of(S::wheel_right, k), -1}});
    const double torque = p_.friction_torque_nm[k] + p_.viscous_friction_nm_s_rad * m.mean_speed_rad_s;
    if (!(torque > 0)) continue;
    lost(add("the " + side + " motor's current at steady speed is", "what the file's friction gives",
             m.steady_current_a * (p_.torque_constant_nm_a / torque), load_off, load_off, 4,
             {{side_of(S::current_right, k), 1}, {side_of(S::wheel_right, k), -1}}),
         {side_of(S::wheel_right, k)});
  }
  if (!heard({0, 1, 4, 5})) return;
  // Straight on, both motors of a pair draw similar currents, independent of the file's parameters.
  add("straight on, the right motor's current is", "the left one's",
      ratio_of_sums(blocks(Relation::siblings), 0, 1, 2), load_off, load_off, 8,
      {{S::current_right, 1}, {S::current_left, -1}, {S::wheel_right, -1}, {S::wheel_left, 1}});
}

// Trust in a number that is estimated from the right and from the left wheel.
double Gatherer::trust_of_sides(const Estimate& right, const Estimate& left, double else_trust) {
  const bool alike = right.sure() && left.sure() &&
                     std::fabs(std::log(std::fabs(right.value / left.value))) < alike_sides &&
                     std::fabs(std::log(std::fabs(right.value))) < skid;
  return alike ? surely_trust : else_trust;
}

// Compares the turning of the robot, from the gyro or the map, with the turning of each wheel.
void Gatherer::turning_by_wheels(const BlockFit& fit, const std::string& turner, S source) {
  const double share = 0.5 / p_.half_track_m;
  const std::array ratio{estimate(fit, 0) * (1 / (share * p_.wheel_radius_m[0])),
                         estimate(fit, 1) * (-1 / (share * p_.wheel_radius_m[1]))};
  const double trust = trust_of_sides(ratio[0], ratio[1], 8);
  for (std::size_t k : {0u, 1u}) {
    ChannelEvidence& e = add(std::string("over the turning of the ") + side_name[k] + " wheel " + turner,
                             "what the file's track gives", ratio[k], skid, track_off, trust,
                             {{source, 1}, {side_of(S::wheel_right, k), -1}});
    e.turned_by = 1;
  }
}

void Gatherer::turning() {
  const bool wheels = heard({0, 1}), gyro = heard({reading::yaw_rate}), heading = heard({reading::heading});
  constexpr std::array<std::size_t, 3> sides_and_one{1, 2, 3};
  constexpr std::array<std::size_t, 2> others{2, 3};
  if (wheels && gyro) {
    turning_by_wheels(fit_blocks(blocks(Relation::gyro), 0, sides_and_one), "the gyro reads", S::yaw_rate);
  }
  if (!heading) return;
  // Headings jump by a full turn, in radians or degrees. The unit with the better fit is the heading's.
  const auto follow = [&](Relation relation) {
    const BlockFit radians = fit_blocks(blocks(relation), 0, others),
                   degrees = fit_blocks(blocks(relation), 1, others);
    const auto unsure = [](const BlockFit& fit) {
      return fit.known() ? std::fabs(fit.sd(0) / fit.coefficient[0]) : 1e9;
    };
    return unsure(degrees) < 0.5 * unsure(radians) ? degrees : radians;
  };
  if (wheels) turning_by_wheels(follow(Relation::heading_wheels), "the map's heading turns", S::heading);
  if (gyro) {
    add("the map's heading turns", "what the gyro reads", estimate(follow(Relation::heading_gyro), 0),
        heading_off, heading_off, 12, {{S::heading, 1}, {S::yaw_rate, -1}});
  }
}

void Gatherer::moving() {
  constexpr std::array<std::size_t, 2> sides{2, 3};
  constexpr std::array<std::size_t, 1> one{1};
  if (!heard({0, 1})) return;
  const bool map = heard({reading::x, reading::y});
  if (map && heard({reading::heading})) {
    const BlockFit fit = fit_blocks(blocks(Relation::travel), 0, sides);
    for (std::size_t k : {0u, 1u}) {
      ChannelEvidence& e =
          add(std::string("the map moves forward over the turning of the ") + side_name[k] + " wheel",
              "what the file's wheel radius gives",
              estimate(fit, static_cast<Eigen::Index>(k)) * (2 / p_.wheel_radius_m[k]), travel_off,
              travel_off, 8, {{S::position, 1}, {side_of(S::wheel_right, k), -1}});
      lost(e, {S::heading});
    }
  }
  if (map) {
    ChannelEvidence& e = add("the map moves", "the way of the wheels by the file's radius",
                             estimate(fit_blocks(blocks(Relation::distance), 0, one), 0), travel_off,
                             travel_off, 12, {{S::position, 1}, {S::wheel_right, -1}});
    e.both_sides = e.magnitude = true;
  }
  // The predominant direction of travel is weak evidence for the forward direction.
  ChannelEvidence& forward =
      add("the way forward, less that backward, is", "all the way that the wheels make",
          ratio_of_sums(blocks(Relation::way), 0, 1, 2), anything, anything, 1, {{S::wheel_right, 1}});
  forward.both_sides = true;
  if (heard({reading::command_speed})) {
    constexpr std::array<std::size_t, 2> commands{2, 3};
    const auto by_command = blocks(Relation::command);
    const std::array ratio{estimate(fit_blocks(by_command, 0, commands), 0),
                           estimate(fit_blocks(by_command, 1, commands), 0)};
    const double trust = trust_of_sides(ratio[0], ratio[1], 5);
    for (std::size_t k : {0u, 1u}) {
      add(std::string("the ") + side_name[k] + " wheel drives at", "the commanded speed", ratio[k],
          command_off, command_off, trust, {{side_of(S::wheel_right, k), 1}, {S::command_speed, -1}});
    }
  }
  if (heard({reading::command_turn})) {
    const Estimate ratio = estimate(fit_blocks(blocks(Relation::command_turn), 0, one), 0);
    const bool surely = std::fabs(std::log(std::fabs(ratio.value))) < track_off &&
                        ratio.sd < alike_sides * std::fabs(ratio.value);
    ChannelEvidence& e = add("the wheels turn the robot at", "the commanded yaw rate", ratio, track_off, skid,
                             surely ? surely_trust : 6, {{S::wheel_right, 1}, {S::command_turn, -1}});
    e.both_sides = true, e.turned_by = 1;
  }
}

void Gatherer::batteries() {
  if (!heard({reading::battery_voltage})) return;
  if (const auto volts = mean_of(reading::battery_voltage)) {
    add("the battery's voltage is", "the file's nominal one",
        {*volts / robot_.battery.nominal_voltage_v, 1e-6, 1e6}, voltage_off, voltage_off, 15,
        {{S::battery_voltage, 1}});
  }
  if (!heard({reading::battery_current})) return;
  constexpr std::array<std::size_t, 2> with_one{1, 2};
  if (heard({2, 3, 4, 5})) {
    ChannelEvidence& e = add(
        "the battery's power follows that of the motors", "what it should",
        estimate(fit_blocks(blocks(Relation::motors), 0, with_one), 0), regeneration_off, driver_off, 12,
        {{S::battery_voltage, 1}, {S::battery_current, 1}, {S::voltage_right, -1}, {S::current_right, -1}});
    e.both_sides = true;
  }
  const Estimate driving = ratio_of_sums(blocks(Relation::driving), 0, 1, 2);
  const Estimate motion = estimate(fit_blocks(blocks(Relation::motion), 0, with_one), 0);
  if (!heard({0, 1})) return;
  for (const bool mean : {true, false}) {
    ChannelEvidence& e = add(mean ? "while the robot drives, the battery's power is"
                                  : "with the motion, the battery's power changes by",
                             "what the model gives", mean ? driving : motion, load_off, load_off,
                             mean ? 8 : 6, {{S::battery_voltage, 1}, {S::battery_current, 1}});
    lost(e, {S::wheel_right, S::wheel_left, S::payload});
    e.both_sides = e.by_power = true;
  }
  // Signs that need no model: a robot that drives without braking consumes power, except downhill; a standing
  // robot consumes power unless it is charged. With long descents and no pitch readings, consumption at
  // standstill is the evidence.
  const auto spends = [&](const char* says, const Estimate& power, double trust) {
    add(says, "what the file's idle power is", power * (1 / std::max(p_.idle_power_w, 1.0)), anything,
        anything, trust, {{S::battery_voltage, 1}, {S::battery_current, 1}});
  };
  spends("driving and not braking, descents left out, the battery gives",
         ratio_of_sums(blocks(Relation::driving), 3, 2, 2), 8);
  const Estimate idle = ratio_of_sums(blocks(Relation::idle), 0, 1, 1);
  spends("standing, the battery gives", idle, idle.value > 0 ? 8 : 1.5);
}

void Gatherer::loads() {
  constexpr std::array<std::size_t, 2> with_one{1, 2};
  if (!heard({reading::pitch})) return;
  if (heard({0, 1, reading::battery_voltage, reading::battery_current})) {
    ChannelEvidence& e =
        add("uphill and downhill, the battery's power changes by", "what the pitch gives",
            estimate(fit_blocks(blocks(Relation::climb), 0, with_one), 0), load_off, load_off, 8,
            {{S::pitch, -1}, {S::wheel_right, 1}, {S::battery_voltage, 1}, {S::battery_current, 1}});
    lost(e, {S::pitch, S::wheel_right, S::wheel_left, S::battery_current, S::battery_voltage});
  }
  if (const ValueTally& pitch = tally(reading::pitch); pitch.known() > 1) {
    ChannelEvidence& e = add("the pitch usually is", "the steepest that robots climb, 20 degrees",
                             {std::hypot(pitch.mean(), pitch.deviation()) / steepest_rad, 1e-6, 1e6}, 0,
                             limit_off, 10, {{S::pitch, 1}});
    e.magnitude = true;
  }
}

void Gatherer::limits() {
  const auto most = [&](const std::string& says, const char* limit, double value, double bound, double trust,
                        S source, bool both_sides = false) {
    if (!(bound > 0 && value > 0)) return;
    ChannelEvidence& e =
        add(says, limit, {value / bound, 1e-6, 1e6}, unused_off, limit_off, trust, {{source, 1}});
    e.magnitude = true, e.both_sides = both_sides;
  };
  if (heard({0, 1})) {
    most("the fastest half second of a mission is usually", "the file's speed limit",
         c_.usual(&Observation::fastest_m_s), robot_.limits.speed_m_s, 6, S::wheel_right, true);
  }
  if (heard({reading::yaw_rate})) {
    most("the fastest turn of a mission is usually", "the file's yaw rate limit",
         c_.usual(&Observation::fastest_turn_rad_s), robot_.limits.yaw_rate_rad_s, 6, S::yaw_rate);
  }
  if (const ValueTally& load = tally(reading::payload); load.known() > 0 && heard({reading::payload})) {
    most("the heaviest payload declared is", "the file's payload limit", load.high(),
         std::max(robot_.limits.payload_kg, 1.0), 10, S::payload);
  }
  for (std::size_t k : {0u, 1u}) {
    const ValueTally &volts = tally(reading::motor_voltage + k), &amps = tally(reading::motor_current + k);
    const std::string side = side_name[k];
    if (volts.known() > 1 && heard({reading::motor_voltage + k})) {
      most("the " + side + " motor's voltage usually is", "the battery's nominal voltage",
           std::hypot(volts.mean(), volts.deviation()), robot_.battery.nominal_voltage_v, 8,
           side_of(S::voltage_right, k));
    }
    if (amps.known() > 1 && heard({reading::motor_current + k})) {
      most("the " + side + " motor's current usually is", "the file's current limit",
           std::hypot(amps.mean(), amps.deviation()), robot_.limits.current_a, 6,
           side_of(S::current_right, k));
    }
  }
}

}  // namespace

std::vector<ChannelEvidence> gather_evidence(const CheckContext& context) {
  return Gatherer(context).gather();
}

}  // namespace joulecast::plausibility
